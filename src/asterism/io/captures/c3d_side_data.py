"""Analog channels, events and force plates of a C3D file.

Malformed parts are left out: a file with sound points is not refused for them.
"""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np

from asterism.io.units import PER_METRE
from asterism.model.side_data import Analog, Event, ForcePlate

if TYPE_CHECKING:
    from numpy.typing import NDArray

    from asterism.io.captures.c3d_layout import C3DFile

__all__ = ["analog_of", "events_of", "plates_of"]


def analog_of(file: C3DFile) -> Analog | None:
    """Return the analog channels of a file, None if it has none."""
    n_frames, n = len(file.analog), max(file.n_samples, 1)
    n_channels = file.analog.shape[1] // n
    if not n_channels or not file.rate:
        return None
    group = file.group("ANALOG")
    names = (group.strings("LABELS") + group.strings("LABELS2"))[:n_channels]
    names += [f"channel {k + 1}" for k in range(len(names), n_channels)]
    units = (group.strings("UNITS") + [""] * n_channels)[:n_channels]
    general = _numbers(group.numbers("GEN_SCALE"), 1, 1.0)[0]
    offsets = _numbers(group.numbers("OFFSET"), n_channels, 0.0)
    if group.strings("FORMAT")[:1] != ["UNSIGNED"]:
        offsets = np.where(offsets >= 2**15, offsets - 2**16, offsets)  # a signed 16-bit integer
    return Analog(
        names=tuple(names),
        units=tuple(units),
        rate=file.rate * n,
        stored=file.analog[:, : n * n_channels].reshape(n_frames * n, n_channels),
        offset=offsets,
        scale=_numbers(group.numbers("SCALE"), n_channels, 1.0) * general,
    )


def events_of(file: C3DFile) -> tuple[Event, ...]:
    """Return the events of the parameter section in the order of their times."""
    group = file.group("EVENT")
    labels, contexts = group.strings("LABELS"), group.strings("CONTEXTS")
    times = np.array(group.numbers("TIMES"))
    times = times[: len(times) // 2 * 2].reshape(-1, 2)  # minutes and seconds
    # The file counts from its frame 1, a capture from its first frame.
    before = (file.first_frame - 1) / file.rate if file.rate else 0.0
    with np.errstate(over="ignore", invalid="ignore"):
        seconds = times[:, 0] * 60 + times[:, 1] - before
    contexts += [""] * len(labels)
    found = [
        Event(time=float(t), label=label, context=context)
        for t, label, context in zip(seconds, labels, contexts, strict=False)
        if np.isfinite(t)
    ]
    return tuple(sorted(found, key=lambda event: event.time))


def plates_of(file: C3DFile, unit: str) -> tuple[ForcePlate, ...]:
    """Return the force plates with four corners, converted from `unit` to metres."""
    group = file.group("FORCE_PLATFORM")
    used, kinds = group.counts("USED")[:1], group.counts("TYPE")
    corners = np.array(group.numbers("CORNERS"))
    origins = np.array(group.numbers("ORIGIN"))
    n = min(*used, len(kinds), len(corners) // 12, len(origins) // 3) if used else 0
    corners = corners[: 12 * n].reshape(n, 4, 3) / PER_METRE[unit]
    origins = origins[: 3 * n].reshape(n, 3) / PER_METRE[unit]
    names = file.group("ANALOG").strings("LABELS") + file.group("ANALOG").strings("LABELS2")
    wired = group.counts("CHANNEL")
    width = len(wired) // used[0] if n and used[0] else 0
    return tuple(
        ForcePlate(
            kind=kinds[k],
            corners=corners[k],
            origin=origins[k],
            channels=tuple(
                names[c - 1] for c in wired[k * width : (k + 1) * width] if 1 <= c <= len(names)
            ),
        )
        for k in range(n)
        if np.isfinite(corners[k]).all() and np.isfinite(origins[k]).all()
    )


def _numbers(given: list[float], n: int, default: float) -> NDArray[np.float64]:
    """Return n numbers of a parameter, the default for those that are missing or not finite."""
    values = np.array((given + [default] * n)[:n], dtype=np.float64)
    return np.where(np.isfinite(values), values, default)
