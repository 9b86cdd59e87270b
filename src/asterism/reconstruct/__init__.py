"""From many views to points: 2-D detections of several cameras become 3-D detections.

The package may be called: ``asterism.reconstruct(observations, rig)`` is
`reconstruct.correspondence.reconstruct`.
"""

from __future__ import annotations

import sys
from types import ModuleType
from typing import Any

from asterism.reconstruct.correspondence import reconstruct
from asterism.reconstruct.image_model import ImageModel
from asterism.reconstruct.images_from_clip import estimate_images
from asterism.reconstruct.reconstruction import Reconstruction, Views
from asterism.reconstruct.triangulation import Triangulation, triangulate
from asterism.reconstruct.uncertainty import (
    CameraSuggestion,
    TriangulationMap,
    suggest_cameras,
    triangulation_map,
)

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


class _CallablePackage(ModuleType):
    # Importing a submodule binds this package to the name `asterism.reconstruct`, over the function
    # of that name: which of the two a user gets must not depend on what was imported before.
    def __call__(self, *args: Any, **kwargs: Any) -> Reconstruction:
        return reconstruct(*args, **kwargs)


sys.modules[__name__].__class__ = _CallablePackage
