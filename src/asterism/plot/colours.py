"""Colours of tracks, by track or by rigid segment, with a legend if it is legible."""

from __future__ import annotations

from typing import TYPE_CHECKING, Any

import numpy as np

from asterism.errors import ParameterError
from asterism.plot.style import CLUTTER, CYCLE, INK

if TYPE_CHECKING:
    from collections.abc import Sequence

    from numpy.typing import ArrayLike

    from asterism.model import Tracks

__all__ = ["add_legend", "colours_of"]

# The colours of the style, and darker ones for the segments of a long legend.
_SEGMENTS = (*CYCLE, "#003A5C", "#7D5500", "#00543D", "#7F3F64", "#1B6A94", "#6E2F00", "#625A00")
_MAX_ENTRIES = len(_SEGMENTS) + 1
_MAX_NAMES = 3  # of an entry


def colours_of(
    tracks: Tracks, segments: ArrayLike | None
) -> tuple[list[str], list[tuple[str, str]]]:
    """Return the colour of each track, and the entries of a legend.

    Parameters
    ----------
    tracks : Tracks
        K tracks.
    segments : array_like of int, shape (K,), optional
        Segment of each track, -1 for none (grey). Without it each track has a colour.

    Returns
    -------
    colours : list of str
        K colours. They repeat after as many as the style has.
    entries : list of (str, str)
        Colour and label of the tracks or segments that have detections; empty if there are too
        many for a legend.

    Raises
    ------
    ParameterError
        If there is not one segment for each track.
    """
    there = np.flatnonzero(tracks.lengths)
    names = tracks.display_names
    if segments is None:
        colours = [CYCLE[k % len(CYCLE)] for k in range(tracks.n_tracks)]
        entries = [(colours[k], names[k]) for k in there]
        return colours, entries if len(entries) <= len(CYCLE) else []
    of = np.asarray(segments)
    if of.shape != (tracks.n_tracks,) or of.dtype.kind not in "iu":
        raise ParameterError(
            "segments", f"{tracks.n_tracks} integers, one for each track", repr(segments)[:60]
        )
    colours = [_SEGMENTS[s % len(_SEGMENTS)] if s >= 0 else CLUTTER for s in of]
    entries = []
    for s in sorted(set(of[there].tolist()), key=lambda s: (s < 0, s)):
        own = [k for k in there if of[k] == s]
        label = "no segment" if s < 0 else _joined([names[k] for k in own])
        entries.append((colours[own[0]], label))
    return colours, entries if len(entries) <= _MAX_ENTRIES else []


def _joined(names: Sequence[str]) -> str:
    """Join a few names, with the prefix of their subject (``Anna:LKNE``) on the first only."""
    prefix = names[0].rpartition(":")[0] + ":"
    shown = [names[0], *(name.removeprefix(prefix) for name in names[1:_MAX_NAMES])]
    return ", ".join(shown) + (" …" if len(names) > _MAX_NAMES else "")


def add_legend(axes: Any, entries: Sequence[tuple[str, str]], *, beside: bool) -> None:
    """Draw a legend in axes, or beside all axes of their figure; none without entries."""
    if not entries:
        return
    from matplotlib.lines import Line2D

    handles = [Line2D([], [], color=colour, linewidth=2.5) for colour, _ in entries]
    style: Any = {
        "loc": "outside right upper" if beside else "best", "frameon": False, "fontsize": 8,
        "labelcolor": INK, "handlelength": 1.2,
    }  # fmt: skip
    owner = axes.figure if beside else axes
    legend = owner.legend(handles, [label for _, label in entries], **style)
    for text in legend.get_texts():
        text.set_parse_math(False)
