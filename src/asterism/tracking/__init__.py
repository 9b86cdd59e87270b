"""Tracking: from detections to tracks of named markers, one package for each step."""

from asterism.tracking.choose import AUTO, Choice, choose_method
from asterism.tracking.confidence import assess
from asterism.tracking.correction import Change, Correction, Stretch, correct
from asterism.tracking.estimation import ModelEstimate, estimate_model, without_common_motion
from asterism.tracking.filling import FilledGap, Filling, fill_gaps
from asterism.tracking.history import TrackHistory, track_states
from asterism.tracking.methods import (
    METHODS,
    ChainOptions,
    Gate,
    HypothesisCluster,
    Lifecycle,
    Method,
    Rigidity,
    TrackStates,
    Update,
    method_by_name,
)
from asterism.tracking.naming import (
    KeptNames,
    NameChange,
    NameConflict,
    Named,
    NamedState,
    Naming,
    check_names,
    learn_marker_set,
    merge_marker_sets,
    name_tracks,
)
from asterism.tracking.pipeline import Tracked, carry_out, track
from asterism.tracking.plan import Plan, plan_tracking
from asterism.tracking.rigidity import Bonds, learn_bonds, learn_shared_acceleration, shared_size
from asterism.tracking.stitching import (
    Join,
    Stitched,
    StitchedState,
    Stitching,
    stitch,
    tracklet_model,
)

__all__ = [
    "AUTO",
    "METHODS",
    "Bonds",
    "ChainOptions",
    "Change",
    "Choice",
    "Correction",
    "FilledGap",
    "Filling",
    "Gate",
    "HypothesisCluster",
    "Join",
    "KeptNames",
    "Lifecycle",
    "Method",
    "ModelEstimate",
    "NameChange",
    "NameConflict",
    "Named",
    "NamedState",
    "Naming",
    "Plan",
    "Rigidity",
    "Stitched",
    "StitchedState",
    "Stitching",
    "Stretch",
    "TrackHistory",
    "TrackStates",
    "Tracked",
    "Update",
    "assess",
    "carry_out",
    "check_names",
    "choose_method",
    "correct",
    "estimate_model",
    "fill_gaps",
    "learn_bonds",
    "learn_marker_set",
    "learn_shared_acceleration",
    "merge_marker_sets",
    "method_by_name",
    "name_tracks",
    "plan_tracking",
    "shared_size",
    "stitch",
    "track",
    "track_states",
    "tracklet_model",
    "without_common_motion",
]
