"""Cameras: lens, pin-hole, rig, the surfaces that hide points, and what is seen of all that."""

from asterism.camera.camera import Camera, intrinsics
from asterism.camera.lens import BrownConrady, Lens, QuadraticCorrection, ReportRadial, ViconRadial
from asterism.camera.observations import Observations
from asterism.camera.projection import Projection, Reason
from asterism.camera.rig import Coverage, Rig, volume_grid
from asterism.camera.surfaces import Capsule, Mesh, Polygon, Surface

__all__ = [
    "BrownConrady",
    "Camera",
    "Capsule",
    "Coverage",
    "Lens",
    "Mesh",
    "Observations",
    "Polygon",
    "Projection",
    "QuadraticCorrection",
    "Reason",
    "ReportRadial",
    "Rig",
    "Surface",
    "ViconRadial",
    "intrinsics",
    "volume_grid",
]
