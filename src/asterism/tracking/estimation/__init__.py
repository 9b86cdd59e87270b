"""The tracking model of a capture, estimated from its detections alone."""

from asterism.tracking.estimation.body_motion import OVER_THREE_FRAMES, fit_body_motion
from asterism.tracking.estimation.common_motion import without_common_motion
from asterism.tracking.estimation.estimate import estimate_model
from asterism.tracking.estimation.fit_to_tracks import fit_to_tracks, model_of
from asterism.tracking.estimation.model_estimate import ModelEstimate

__all__ = [
    "OVER_THREE_FRAMES",
    "ModelEstimate",
    "estimate_model",
    "fit_body_motion",
    "fit_to_tracks",
    "model_of",
    "without_common_motion",
]
