"""The tracking model of a capture, estimated from its detections alone."""

from asterism.tracking.estimation.body_motion import fit_body_motion
from asterism.tracking.estimation.estimate import estimate_model
from asterism.tracking.estimation.model_estimate import ModelEstimate

__all__ = ["ModelEstimate", "estimate_model", "fit_body_motion"]
