"""Multi-view reconstruction: from 2-D image points of several cameras to 3-D detections."""

from __future__ import annotations

from asterism.multiview.image_estimation import estimate_images
from asterism.multiview.image_model import ImageModel
from asterism.multiview.reconstruction import Reconstruction, Views
from asterism.multiview.triangulation import Triangulation, triangulate
from asterism.multiview.uncertainty import (
    CameraSuggestion,
    TriangulationMap,
    suggest_cameras,
    triangulation_map,
)
from asterism.multiview.views_to_points import reconstruct

__all__ = [
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
]
