"""Asterism: name the points of light.

Which point of an optical motion capture is which marker, over time, and how sure is it? Detections
in, tracks out; every method searches the posterior of one generative model.

>>> import asterism as am
>>> capture = am.read("trial.c3d")                        # doctest: +SKIP
>>> tracks = am.track(capture, am.GNN())                  # doctest: +SKIP
>>> am.write(tracks, "trial.tracked.c3d")                 # doctest: +SKIP
"""

from __future__ import annotations

import importlib
from typing import TYPE_CHECKING, Any

if TYPE_CHECKING:
    from asterism.errors import AsterismError as AsterismError
    from asterism.errors import FormatError as FormatError
    from asterism.errors import ParameterError as ParameterError
    from asterism.errors import SolverLimit as SolverLimit
    from asterism.model import DWNA as DWNA
    from asterism.model import DWPA as DWPA
    from asterism.model import Capture as Capture
    from asterism.model import Detections as Detections
    from asterism.model import InteractingMotions as InteractingMotions
    from asterism.model import LinearMotion as LinearMotion
    from asterism.model import Motion as Motion
    from asterism.model import Population as Population
    from asterism.model import RandomWalk as RandomWalk
    from asterism.model import Sensor as Sensor
    from asterism.model import TrackingModel as TrackingModel
    from asterism.model import Tracks as Tracks

__version__ = "0.1.0"

# Public name -> module. Nothing is imported before its first use, so that `import asterism` and
# `asterism --help` are instant.
_HOME = {
    **dict.fromkeys(("AsterismError", "FormatError", "ParameterError", "SolverLimit"), "errors"),
    **dict.fromkeys(
        (
            "DWNA", "DWPA", "Capture", "Detections", "InteractingMotions", "LinearMotion", "Motion", "Population",
            "RandomWalk", "Sensor", "TrackingModel", "Tracks",
        ),
        "model",
    ),
}  # fmt: skip

__all__ = ["__version__", *sorted(_HOME)]  # pyright: ignore[reportUnsupportedDunderAll]


def __getattr__(name: str) -> Any:
    if name not in _HOME:
        raise AttributeError(f"module 'asterism' has no attribute {name!r}")
    value = getattr(importlib.import_module(f"asterism.{_HOME[name]}"), name)
    globals()[name] = value
    return value


def __dir__() -> list[str]:
    return sorted({*globals(), *_HOME})
