"""Pictures: matplotlib axes in, axes out; no global state, nothing is shown or saved.

>>> from asterism.plot import plot_presence
>>> plot_presence(tracks).figure.savefig("presence.pdf")  # doctest: +SKIP
"""

from __future__ import annotations

from asterism.plot.compare import plot_compare
from asterism.plot.confidence import plot_confidence, plot_identity, plot_reliability
from asterism.plot.coverage import plot_coverage
from asterism.plot.export import figure_bytes
from asterism.plot.groups import plot_groups
from asterism.plot.image import plot_depth, plot_image
from asterism.plot.lens import plot_lens
from asterism.plot.over_time import plot_axes
from asterism.plot.posterior import plot_posterior
from asterism.plot.presence import plot_errors, plot_presence
from asterism.plot.projections import plot_projections
from asterism.plot.rerun_scene import view
from asterism.plot.rig import plot_rig
from asterism.plot.sweep import plot_sweep
from asterism.plot.trajectories import plot_trajectories

__all__ = [
    "figure_bytes",
    "plot_axes",
    "plot_compare",
    "plot_confidence",
    "plot_coverage",
    "plot_depth",
    "plot_errors",
    "plot_groups",
    "plot_identity",
    "plot_image",
    "plot_lens",
    "plot_posterior",
    "plot_presence",
    "plot_projections",
    "plot_reliability",
    "plot_rig",
    "plot_sweep",
    "plot_trajectories",
    "view",
]
