"""Runs of captures: one with its folder, or many with the same settings, on several machines."""

from asterism.batch.find import Planned, plan_batch
from asterism.batch.job import Job, Settings
from asterism.batch.perform import Outcome
from asterism.batch.run_batch import Batch, run

__all__ = ["Batch", "Job", "Outcome", "Planned", "Settings", "plan_batch", "run"]
