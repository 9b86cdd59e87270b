"""Monte Carlo studies: scenes or captures × corruptions × methods × seeds."""

from asterism.sweep.run_sweep import Sweep, run
from asterism.sweep.score import truth_of
from asterism.sweep.study import Case, Study, read_study

__all__ = ["Case", "Study", "Sweep", "read_study", "run", "truth_of"]
