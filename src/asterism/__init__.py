"""Asterism: name the points of light.

Which point of an optical motion capture is which marker, over time, and how sure is it? Detections
in, tracks out; every method searches the posterior of one generative model.

>>> import asterism as am
>>> capture = am.read("trial.c3d")                        # doctest: +SKIP
>>> tracks = am.track(capture)                            # doctest: +SKIP
>>> am.write(tracks, "trial.tracked.c3d")                 # doctest: +SKIP
"""

from __future__ import annotations

import importlib
from typing import TYPE_CHECKING, Any

if TYPE_CHECKING:
    from asterism import simulate as simulate
    from asterism.associate import GNN as GNN
    from asterism.associate import JPDA as JPDA
    from asterism.associate import MCMCDA as MCMCDA
    from asterism.associate import MDA as MDA
    from asterism.associate import METHODS as METHODS
    from asterism.associate import MHT as MHT
    from asterism.associate import SMP as SMP
    from asterism.associate import TOMHT as TOMHT
    from asterism.associate import Choice as Choice
    from asterism.associate import HypothesisCluster as HypothesisCluster
    from asterism.associate import Method as Method
    from asterism.associate import ModelEstimate as ModelEstimate
    from asterism.associate import TrackSplitting as TrackSplitting
    from asterism.associate import Update as Update
    from asterism.associate import choose_method as choose_method
    from asterism.associate import estimate_model as estimate_model
    from asterism.associate import method_by_name as method_by_name
    from asterism.camera import BrownConrady as BrownConrady
    from asterism.camera import Camera as Camera
    from asterism.camera import Capsule as Capsule
    from asterism.camera import Coverage as Coverage
    from asterism.camera import DepthImage as DepthImage
    from asterism.camera import Face as Face
    from asterism.camera import Lens as Lens
    from asterism.camera import LensFit as LensFit
    from asterism.camera import Mesh as Mesh
    from asterism.camera import Observations as Observations
    from asterism.camera import Painting as Painting
    from asterism.camera import Polygon as Polygon
    from asterism.camera import Projection as Projection
    from asterism.camera import QuadraticCorrection as QuadraticCorrection
    from asterism.camera import Reason as Reason
    from asterism.camera import ReportRadial as ReportRadial
    from asterism.camera import Rig as Rig
    from asterism.camera import Surface as Surface
    from asterism.camera import ViconRadial as ViconRadial
    from asterism.camera import fit_lens as fit_lens
    from asterism.camera import intrinsics as intrinsics
    from asterism.camera import volume_grid as volume_grid
    from asterism.errors import AsterismError as AsterismError
    from asterism.errors import FormatError as FormatError
    from asterism.errors import ParameterError as ParameterError
    from asterism.errors import SolverLimit as SolverLimit
    from asterism.evaluate import Alignment as Alignment
    from asterism.evaluate import AssociationScores as AssociationScores
    from asterism.evaluate import Calibration as Calibration
    from asterism.evaluate import ClearScores as ClearScores
    from asterism.evaluate import Evaluation as Evaluation
    from asterism.evaluate import GospaScores as GospaScores
    from asterism.evaluate import HotaScores as HotaScores
    from asterism.evaluate import IdentityScores as IdentityScores
    from asterism.evaluate import PointScores as PointScores
    from asterism.evaluate import align as align
    from asterism.evaluate import association_scores as association_scores
    from asterism.evaluate import calibration as calibration
    from asterism.evaluate import clear_scores as clear_scores
    from asterism.evaluate import evaluate as evaluate
    from asterism.evaluate import floor as floor
    from asterism.evaluate import gospa_scores as gospa_scores
    from asterism.evaluate import hota_scores as hota_scores
    from asterism.evaluate import identity_scores as identity_scores
    from asterism.evaluate import point_scores as point_scores
    from asterism.evaluate import right_links as right_links
    from asterism.filter import GateGroups as GateGroups
    from asterism.filter import States as States
    from asterism.filter import expected_places as expected_places
    from asterism.filter import filter_states as filter_states
    from asterism.filter import gate_groups as gate_groups
    from asterism.filter import smooth as smooth
    from asterism.io import FORMATS as FORMATS
    from asterism.io import CaptureInfo as CaptureInfo
    from asterism.io import Format as Format
    from asterism.io import describe as describe
    from asterism.io import read as read
    from asterism.io import read_tracks as read_tracks
    from asterism.io import write as write
    from asterism.io.calibration import CALIBRATIONS as CALIBRATIONS
    from asterism.io.calibration import read_rig as read_rig
    from asterism.io.calibration import write_rig as write_rig
    from asterism.io.observations import read_observations as read_observations
    from asterism.io.observations import write_observations as write_observations
    from asterism.label import Bonds as Bonds
    from asterism.label import Filling as Filling
    from asterism.label import Gap as Gap
    from asterism.label import Join as Join
    from asterism.label import Recognition as Recognition
    from asterism.label import Stitched as Stitched
    from asterism.label import Stitching as Stitching
    from asterism.label import fill as fill
    from asterism.label import fragment_model as fragment_model
    from asterism.label import identify as identify
    from asterism.label import learn_bonds as learn_bonds
    from asterism.label import recognize as recognize
    from asterism.label import stitch as stitch
    from asterism.label import track as track
    from asterism.model import DWNA as DWNA
    from asterism.model import DWPA as DWPA
    from asterism.model import Capture as Capture
    from asterism.model import Detections as Detections
    from asterism.model import InteractingMotions as InteractingMotions
    from asterism.model import LinearMotion as LinearMotion
    from asterism.model import Motion as Motion
    from asterism.model import Population as Population
    from asterism.model import RandomWalk as RandomWalk
    from asterism.model import Sensor as Sensor
    from asterism.model import TrackingModel as TrackingModel
    from asterism.model import Tracks as Tracks
    from asterism.model.posterior import log_posterior as log_posterior
    from asterism.model.posterior import track_scores as track_scores
    from asterism.reconstruct import CameraSuggestion as CameraSuggestion
    from asterism.reconstruct import ImageModel as ImageModel
    from asterism.reconstruct import Reconstruction as Reconstruction
    from asterism.reconstruct import Triangulation as Triangulation
    from asterism.reconstruct import TriangulationMap as TriangulationMap
    from asterism.reconstruct import Views as Views
    from asterism.reconstruct import estimate_images as estimate_images
    from asterism.reconstruct import reconstruct as reconstruct
    from asterism.reconstruct import suggest_cameras as suggest_cameras
    from asterism.reconstruct import triangulate as triangulate
    from asterism.reconstruct import triangulation_map as triangulation_map
    from asterism.reporting import report as report
    from asterism.solve import JointMarginals as JointMarginals
    from asterism.solve import KBestAssignments as KBestAssignments
    from asterism.solve import MultidimensionalAssignment as MultidimensionalAssignment
    from asterism.solve import assign_multidimensional as assign_multidimensional
    from asterism.solve import joint_marginals as joint_marginals
    from asterism.solve import k_best_assignments as k_best_assignments
    from asterism.view import figure_bytes as figure_bytes
    from asterism.view import plot_axes as plot_axes
    from asterism.view import plot_compare as plot_compare
    from asterism.view import plot_confidence as plot_confidence
    from asterism.view import plot_coverage as plot_coverage
    from asterism.view import plot_depth as plot_depth
    from asterism.view import plot_errors as plot_errors
    from asterism.view import plot_groups as plot_groups
    from asterism.view import plot_image as plot_image
    from asterism.view import plot_lens as plot_lens
    from asterism.view import plot_posterior as plot_posterior
    from asterism.view import plot_presence as plot_presence
    from asterism.view import plot_projections as plot_projections
    from asterism.view import plot_reliability as plot_reliability
    from asterism.view import plot_rig as plot_rig
    from asterism.view import plot_trajectories as plot_trajectories
    from asterism.view import view as view

__version__ = "0.1.0"

# Where each public name lives. Nothing is imported before its first use, so that `import asterism`
# and `asterism --help` are instant.
_PUBLIC = {
    "errors": ("AsterismError", "FormatError", "ParameterError", "SolverLimit"),
    "camera": (
        "BrownConrady",
        "Camera",
        "Capsule",
        "Coverage",
        "DepthImage",
        "Face",
        "Lens",
        "LensFit",
        "Mesh",
        "Observations",
        "Painting",
        "Polygon",
        "Projection",
        "QuadraticCorrection",
        "Reason",
        "ReportRadial",
        "Rig",
        "Surface",
        "ViconRadial",
        "fit_lens",
        "intrinsics",
        "volume_grid",
    ),
    "model": (
        "DWNA",
        "DWPA",
        "Capture",
        "Detections",
        "InteractingMotions",
        "LinearMotion",
        "Motion",
        "Population",
        "RandomWalk",
        "Sensor",
        "TrackingModel",
        "Tracks",
    ),
    "model.posterior": ("log_posterior", "track_scores"),
    "filter": ("GateGroups", "States", "expected_places", "filter_states", "gate_groups", "smooth"),
    "associate": (
        "GNN",
        "METHODS",
        "JPDA",
        "MCMCDA",
        "MDA",
        "MHT",
        "SMP",
        "TOMHT",
        "TrackSplitting",
        "Choice",
        "HypothesisCluster",
        "Method",
        "ModelEstimate",
        "Update",
        "choose_method",
        "estimate_model",
        "method_by_name",
    ),
    "label": (
        "Bonds",
        "Filling",
        "Gap",
        "Join",
        "Recognition",
        "Stitched",
        "Stitching",
        "fill",
        "fragment_model",
        "identify",
        "learn_bonds",
        "recognize",
        "stitch",
        "track",
    ),
    "reconstruct": (
        "CameraSuggestion",
        "ImageModel",
        "Reconstruction",
        "Triangulation",
        "TriangulationMap",
        "Views",
        "estimate_images",
        "reconstruct",
        "suggest_cameras",
        "triangulate",
        "triangulation_map",
    ),
    "solve": (
        "JointMarginals",
        "KBestAssignments",
        "MultidimensionalAssignment",
        "assign_multidimensional",
        "joint_marginals",
        "k_best_assignments",
    ),
    "evaluate": (
        "Alignment",
        "AssociationScores",
        "Calibration",
        "ClearScores",
        "Evaluation",
        "GospaScores",
        "HotaScores",
        "IdentityScores",
        "PointScores",
        "align",
        "association_scores",
        "calibration",
        "clear_scores",
        "evaluate",
        "floor",
        "gospa_scores",
        "hota_scores",
        "identity_scores",
        "point_scores",
        "right_links",
    ),
    "io": ("FORMATS", "CaptureInfo", "Format", "describe", "read", "read_tracks", "write"),
    "io.calibration": ("CALIBRATIONS", "read_rig", "write_rig"),
    "io.observations": ("read_observations", "write_observations"),
    "reporting": ("report",),
    "view": (
        "figure_bytes",
        "plot_axes",
        "plot_compare",
        "plot_confidence",
        "plot_coverage",
        "plot_depth",
        "plot_errors",
        "plot_groups",
        "plot_image",
        "plot_lens",
        "plot_posterior",
        "plot_presence",
        "plot_projections",
        "plot_reliability",
        "plot_rig",
        "plot_trajectories",
        "view",
    ),
}
_HOME = {name: module for module, names in _PUBLIC.items() for name in names}
_PACKAGES = ("simulate",)

__all__ = ["__version__", *_PACKAGES, *sorted(_HOME)]  # pyright: ignore[reportUnsupportedDunderAll]


def __getattr__(name: str) -> Any:
    if name in _PACKAGES:
        return importlib.import_module(f"asterism.{name}")
    if name not in _HOME:
        raise AttributeError(f"module 'asterism' has no attribute {name!r}")
    value = getattr(importlib.import_module(f"asterism.{_HOME[name]}"), name)
    globals()[name] = value
    return value


def __dir__() -> list[str]:
    return sorted({*globals(), *__all__})
