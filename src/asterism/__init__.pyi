from . import (
    camera,
    filter,
    io,
    metrics,
    model,
    multiview,
    plot,
    simulate,
    solve,
    tracking,
)
from .camera import Camera, Observations, Rig
from .errors import AsterismError, FormatError, ParameterError, SolverLimit
from .io import read, read_rig, write
from .metrics import evaluate
from .model import (
    DWNA,
    DWPA,
    Capture,
    Detections,
    InteractingMotions,
    Population,
    RandomWalk,
    Sensor,
    TrackingModel,
    Tracks,
    log_posterior,
)
from .multiview import reconstruct
from .reporting import report
from .tracking import estimate_model, fill_gaps, learn_bonds, name_tracks, stitch, track
from .tracking.methods import GNN, JPDA, MCMCDA, MDA, MHT, SMP, TOMHT, TrackSplitting

__all__ = [
    "DWNA",
    "DWPA",
    "GNN",
    "JPDA",
    "MCMCDA",
    "MDA",
    "MHT",
    "SMP",
    "TOMHT",
    "AsterismError",
    "Camera",
    "Capture",
    "Detections",
    "FormatError",
    "InteractingMotions",
    "Observations",
    "ParameterError",
    "Population",
    "RandomWalk",
    "Rig",
    "Sensor",
    "SolverLimit",
    "TrackSplitting",
    "TrackingModel",
    "Tracks",
    "__version__",
    "camera",
    "estimate_model",
    "evaluate",
    "fill_gaps",
    "filter",
    "io",
    "learn_bonds",
    "log_posterior",
    "metrics",
    "model",
    "multiview",
    "name_tracks",
    "plot",
    "read",
    "read_rig",
    "reconstruct",
    "report",
    "simulate",
    "solve",
    "stitch",
    "track",
    "tracking",
    "write",
]

__version__: str
