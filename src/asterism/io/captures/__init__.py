"""Reading and writing of captures, one module per format."""

from asterism.io.captures.files import read, read_tracks, write
from asterism.io.captures.formats import CAPTURE_FORMATS, CaptureFormat
from asterism.io.captures.info import CaptureInfo, describe

__all__ = [
    "CAPTURE_FORMATS",
    "CaptureFormat",
    "CaptureInfo",
    "describe",
    "read",
    "read_tracks",
    "write",
]
