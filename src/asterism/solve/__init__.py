"""Combinatorial solvers on plain arrays: they know nothing of tracks, frames or models."""

from asterism.solve.joint_events import JointMarginals, joint_marginals
from asterism.solve.k_best import KBestAssignments, k_best_assignments

__all__ = ["JointMarginals", "KBestAssignments", "joint_marginals", "k_best_assignments"]
