"""Cameras: lenses, rigs, occluding surfaces, projection and image points."""

from asterism.camera.camera import Camera
from asterism.camera.depth_image import DepthImage
from asterism.camera.lens import BrownConrady, Lens, QuadraticCorrection, ReportRadial, ViconRadial
from asterism.camera.lens_fit import LensFit, fit_lens
from asterism.camera.matrices import intrinsics
from asterism.camera.observations import Observations
from asterism.camera.painter import Face, Painting
from asterism.camera.projection import Projection, Reason
from asterism.camera.rig import Coverage, Rig, volume_grid
from asterism.camera.surfaces import Capsule, Mesh, Polygon, Surface

__all__ = [
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
]
