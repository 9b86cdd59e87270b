"""Kalman filter and smoother of many tracks at once, and the gates of their predictions."""

from asterism.filter.expected import expected_positions
from asterism.filter.gates import GateGroups, gate_groups
from asterism.filter.kalman import States, filter_states, smooth_states

__all__ = [
    "GateGroups",
    "States",
    "expected_positions",
    "filter_states",
    "gate_groups",
    "smooth_states",
]
