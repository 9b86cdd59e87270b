"""From many views to points: 2-D detections of several cameras become 3-D detections."""

from asterism.reconstruct.triangulation import Triangulation, triangulate

__all__ = ["Triangulation", "triangulate"]
