"""Methods of association, one file for each, and their common parts."""

from asterism.tracking.methods.base import Method, Update
from asterism.tracking.methods.chain_options import ChainOptions
from asterism.tracking.methods.gnn import GNN
from asterism.tracking.methods.jpda import JPDA
from asterism.tracking.methods.mcmcda import MCMCDA
from asterism.tracking.methods.mda import MDA
from asterism.tracking.methods.mht import MHT, HypothesisCluster
from asterism.tracking.methods.options import Gate, Lifecycle, Rigidity
from asterism.tracking.methods.registry import METHODS, method_by_name, options_of
from asterism.tracking.methods.smp import SMP
from asterism.tracking.methods.states import TrackStates
from asterism.tracking.methods.tomht import TOMHT
from asterism.tracking.methods.track_splitting import TrackSplitting

__all__ = [
    "GNN",
    "JPDA",
    "MCMCDA",
    "MDA",
    "METHODS",
    "MHT",
    "SMP",
    "TOMHT",
    "ChainOptions",
    "Gate",
    "HypothesisCluster",
    "Lifecycle",
    "Method",
    "Rigidity",
    "TrackSplitting",
    "TrackStates",
    "Update",
    "method_by_name",
    "options_of",
]
