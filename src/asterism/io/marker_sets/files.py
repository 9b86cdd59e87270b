"""Reading marker sets of any known format."""

from __future__ import annotations

from typing import TYPE_CHECKING

from asterism.checks import check_file, check_path
from asterism.errors import not_read
from asterism.io.marker_sets import vicon
from asterism.io.text_table import as_utf8
from asterism.model import MarkerSet

if TYPE_CHECKING:
    from pathlib import Path

__all__ = ["read_marker_set"]

_HEAD = 1 << 12  # bytes that are enough to know XML by


def read_marker_set(path: str | Path) -> MarkerSet:
    """Read the marker set of a subject or of a labelling template.

    Parameters
    ----------
    path : path
        ``.toml``, as `MarkerSet.to_toml` writes it; ``.vsk``, a subject of Vicon; or ``.vst``, a
        labelling template of Vicon. The content determines whether a file is XML or TOML.

    Returns
    -------
    MarkerSet
        Markers with places and distances in metres; the z axis points up in those of Vicon.

    Raises
    ------
    FormatError
        If the file does not exist, has another format, or is malformed.

    Notes
    -----
    A Vicon file states segments, joints and the markers of each segment. Distances are means over
    64 postures, and `MarkerSet.movements` their standard deviations; within a segment they are
    exact. `MarkerSet.variations` contain the error of the joint centres. Those of a template, and
    of a subject whose sizes equal the template's because it was never calibrated, are larger.
    Arms that stretch sideways (T-pose) hang in `MarkerSet.places`. Optional markers have presence
    0.5, markers for the calibration alone (``STATUS="constraint"``) presence 0.

    Examples
    --------
    >>> import asterism as am, tempfile
    >>> made = am.MarkerSet(names=("A", "B"), places=[[0, 0, 0], [1, 0, 0]])
    >>> with tempfile.TemporaryDirectory() as folder:
    ...     _ = made.to_toml(f"{folder}/set.toml")
    ...     read_marker_set(f"{folder}/set.toml")
    MarkerSet(2 markers, 1 subject)
    >>> read_marker_set("none.vsk")
    Traceback (most recent call last):
    ...
    asterism.errors.FormatError: none.vsk: no such file
    """
    path = check_path("path", path)
    check_file(path, "a marker set")
    try:
        with path.open("rb") as file:
            head = as_utf8(file.read(_HEAD)).removeprefix(b"\xef\xbb\xbf").lstrip()
        # An empty or damaged file is reported by the reader of its ending.
        if head.startswith(b"<") or path.suffix.lower() in vicon.SUFFIXES:
            return vicon.read(path)
    except OSError as error:
        raise not_read(path, error) from error
    return MarkerSet.from_toml(path)
