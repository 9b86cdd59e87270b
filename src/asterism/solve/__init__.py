"""Combinatorial solvers on plain arrays, independent of tracks, frames and models."""

from asterism.solve.joint_events import JointMarginals, joint_marginals
from asterism.solve.k_best import KBestAssignments, k_best_assignments
from asterism.solve.multidimensional import MultidimensionalAssignment, assign_multidimensional

__all__ = [
    "JointMarginals",
    "KBestAssignments",
    "MultidimensionalAssignment",
    "assign_multidimensional",
    "joint_marginals",
    "k_best_assignments",
]
