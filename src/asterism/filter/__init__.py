"""Kalman filter and smoother over many tracks at once, and the gates about what they foresee."""

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
