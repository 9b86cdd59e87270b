"""What things are: detections, tracks and the one generative model that every method searches."""

from asterism.model.detections import Capture, Detections
from asterism.model.motion import DWNA, DWPA, InteractingMotions, LinearMotion, Motion, RandomWalk
from asterism.model.population import Population
from asterism.model.sensor import Sensor
from asterism.model.tracking_model import TrackingModel
from asterism.model.tracks import Tracks

__all__ = [
    "DWNA",
    "DWPA",
    "Capture",
    "Detections",
    "InteractingMotions",
    "LinearMotion",
    "Motion",
    "Population",
    "RandomWalk",
    "Sensor",
    "TrackingModel",
    "Tracks",
]
