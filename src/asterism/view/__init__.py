"""Pictures of tracks: matplotlib axes in, axes out; no global state, nothing is shown or saved.

>>> from asterism.view import plot_presence
>>> plot_presence(tracks).figure.savefig("presence.pdf")  # doctest: +SKIP
"""

from asterism.view.presence import plot_errors, plot_presence
from asterism.view.trajectories import plot_trajectories

__all__ = ["plot_errors", "plot_presence", "plot_trajectories"]
