"""Data types: detections, tracks, captures and the generative model that every method searches."""

from asterism.model.capture import Capture
from asterism.model.decision import Alternative, Decision
from asterism.model.detections import Detections
from asterism.model.edit import Edit
from asterism.model.gap import Gap
from asterism.model.interacting_motions import InteractingMotions
from asterism.model.linear_motion import LinearMotion
from asterism.model.marker_set import MarkerSet
from asterism.model.motion import DWNA, DWPA, Motion, RandomWalk, SingleMotion
from asterism.model.population import Population
from asterism.model.posterior import log_posterior, track_scores
from asterism.model.recipe import Recipe
from asterism.model.sensor import Sensor
from asterism.model.shared_acceleration import SharedAcceleration, shared_gains
from asterism.model.side_data import Analog, Event, ForcePlate
from asterism.model.tracking_model import TrackingModel
from asterism.model.tracks import Tracks

__all__ = [
    "DWNA",
    "DWPA",
    "Alternative",
    "Analog",
    "Capture",
    "Decision",
    "Detections",
    "Edit",
    "Event",
    "ForcePlate",
    "Gap",
    "InteractingMotions",
    "LinearMotion",
    "MarkerSet",
    "Motion",
    "Population",
    "RandomWalk",
    "Recipe",
    "Sensor",
    "SharedAcceleration",
    "SingleMotion",
    "TrackingModel",
    "Tracks",
    "log_posterior",
    "shared_gains",
    "track_scores",
]
