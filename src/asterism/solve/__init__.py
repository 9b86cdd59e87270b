"""Combinatorial solvers on plain arrays: they know nothing of tracks, frames or models."""

from asterism.solve.joint_events import JointMarginals, joint_marginals

__all__ = ["JointMarginals", "joint_marginals"]
