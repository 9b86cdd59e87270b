"""Pictures: matplotlib axes in, axes out; no global state, nothing is shown or saved.

>>> from asterism.view import plot_presence
>>> plot_presence(tracks).figure.savefig("presence.pdf")  # doctest: +SKIP
"""

from asterism.view.coverage import plot_coverage
from asterism.view.image import plot_depth, plot_image
from asterism.view.lens import plot_lens
from asterism.view.presence import plot_errors, plot_presence
from asterism.view.rig import plot_rig
from asterism.view.trajectories import plot_trajectories

__all__ = [
    "plot_coverage",
    "plot_depth",
    "plot_errors",
    "plot_image",
    "plot_lens",
    "plot_presence",
    "plot_rig",
    "plot_trajectories",
]
