"""Runs of captures: one with its folder, or many with the same settings, on several machines."""

from asterism.batch.cluster_map import cluster_map
from asterism.batch.find import Planned, plan_batch
from asterism.batch.job import Job, Settings
from asterism.batch.perform import Outcome
from asterism.batch.run_batch import Batch, run

__all__ = ["Batch", "Job", "Outcome", "Planned", "Settings", "cluster_map", "plan_batch", "run"]
