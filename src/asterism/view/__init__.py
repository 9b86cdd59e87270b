"""Pictures: matplotlib axes in, axes out; no global state, nothing is shown or saved.

>>> from asterism.view import plot_presence
>>> plot_presence(tracks).figure.savefig("presence.pdf")  # doctest: +SKIP

The package may be called: ``asterism.view(tracks)`` is `view.view`, which opens Rerun's viewer.
"""

from __future__ import annotations

import sys
from types import ModuleType
from typing import Any

from asterism.view.compare import plot_compare
from asterism.view.confidence import plot_confidence, plot_reliability
from asterism.view.coverage import plot_coverage
from asterism.view.export import figure_bytes
from asterism.view.groups import plot_groups
from asterism.view.image import plot_depth, plot_image
from asterism.view.lens import plot_lens
from asterism.view.over_time import plot_axes
from asterism.view.posterior import plot_posterior
from asterism.view.presence import plot_errors, plot_presence
from asterism.view.projections import plot_projections
from asterism.view.rig import plot_rig
from asterism.view.scene import view
from asterism.view.trajectories import plot_trajectories

__all__ = [
    "figure_bytes",
    "plot_axes",
    "plot_compare",
    "plot_confidence",
    "plot_coverage",
    "plot_depth",
    "plot_errors",
    "plot_groups",
    "plot_image",
    "plot_lens",
    "plot_posterior",
    "plot_presence",
    "plot_projections",
    "plot_reliability",
    "plot_rig",
    "plot_trajectories",
    "view",
]


class _CallablePackage(ModuleType):
    # Importing a submodule binds this package to the name `asterism.view`, over the function of
    # that name: which of the two a user gets must not depend on what was imported before.
    def __call__(self, *args: Any, **kwargs: Any) -> None:
        view(*args, **kwargs)


sys.modules[__name__].__class__ = _CallablePackage
