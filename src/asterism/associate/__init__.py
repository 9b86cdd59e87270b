"""Who is whom: one file a method, plus what they share."""

from asterism.associate.auto import AUTO, Choice, choose_method
from asterism.associate.gnn import GNN
from asterism.associate.jpda import JPDA
from asterism.associate.mcmcda import MCMCDA
from asterism.associate.mda import MDA
from asterism.associate.method import Method, Update
from asterism.associate.mht import MHT, HypothesisCluster
from asterism.associate.model_estimate import ModelEstimate
from asterism.associate.model_from_clip import estimate_model
from asterism.associate.registry import METHODS, method_by_name
from asterism.associate.smp import SMP
from asterism.associate.tomht import TOMHT
from asterism.associate.track_splitting import TrackSplitting

__all__ = [
    "AUTO",
    "GNN",
    "JPDA",
    "MCMCDA",
    "MDA",
    "METHODS",
    "MHT",
    "SMP",
    "TOMHT",
    "Choice",
    "HypothesisCluster",
    "Method",
    "ModelEstimate",
    "TrackSplitting",
    "Update",
    "choose_method",
    "estimate_model",
    "method_by_name",
]
