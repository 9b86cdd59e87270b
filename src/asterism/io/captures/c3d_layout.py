"""Layout of a C3D file: header, parameters, and one block of points and analog values per frame.

The reader accepts files that are damaged (it reads the intact part), malicious (it allocates no
more than the file can fill) or long (more than 65535 frames).
Format: the C3D user guide, https://www.c3d.org.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import TYPE_CHECKING, Any

import numpy as np

from asterism.errors import FormatError
from asterism.io.captures.c3d_parameters import BLOCK, DEC, INTEL, SGI, Group, decode, parse

if TYPE_CHECKING:
    from pathlib import Path

    from numpy.typing import NDArray

__all__ = ["C3DFile", "read_c3d"]


@dataclass(frozen=True, eq=False)
class C3DFile:
    """A C3D file in memory.

    Parameters
    ----------
    header : bytes
        First block, in Intel order.
    groups : dict of str to Group
        Groups of parameters by name.
    points : ndarray of shape (T, K, 4), float32
        x, y, z in the file's unit, and the word of residual and cameras (negative: missed
        detection).
    analog : ndarray of shape (T, A), float32
        Analog values as stored, all samples of a frame in one row.
    n_samples : int
        Analog samples per frame.
    first_frame : int
        Number of the first frame in the file.
    rate : float
        Frame rate in Hz, 0 if the file does not state it.
    scale : float
        Size of one step of the residuals (and of integer points), positive.
    warnings : tuple of str
        Irregularities of the file.
    truncated : str
        Place at which the file is cut off, and the missing part; empty for a complete file.
    """

    header: bytes
    groups: dict[str, Group]
    points: NDArray[np.float32]
    analog: NDArray[np.float32]
    n_samples: int
    first_frame: int
    rate: float
    scale: float
    warnings: tuple[str, ...]
    truncated: str = ""

    def group(self, name: str) -> Group:
        """Return the group of a name, an empty one if the file has none."""
        return self.groups.get(name, Group())


def read_c3d(path: Path) -> C3DFile:
    """Read a C3D file.

    Parameters
    ----------
    path : Path
        C3D file.

    Returns
    -------
    C3DFile
        Complete frames of the file; an incomplete last frame is dropped with its analog samples.

    Raises
    ------
    FormatError
        If the file is not C3D, or declares frames and holds no complete one.
    """
    raw = path.read_bytes()
    if len(raw) < BLOCK or raw[1] != 0x50:
        got = f"{len(raw)} bytes, beginning with {raw[:4]!r}"
        raise FormatError(path, "header", "a C3D header of 512 bytes, byte 2 = 0x50", got)
    warnings: list[str] = []
    processor, groups = _parameters(raw, warnings)
    header = _intel_header(raw[:BLOCK], processor)
    words = [int(w) for w in np.frombuffer(header, "<u2", 10)]
    n_points, n_analog, first, last = words[1:5]
    scale, rate = (float(np.frombuffer(header, "<f4", 1, byte)[0]) for byte in (12, 20))
    point = groups.get("POINT", Group())
    stated = next((n for n in point.counts("USED") if n <= 0xFFFF), n_points)
    if stated != n_points:
        warnings.append(f"{stated} points (POINT:USED) are read; the header states {n_points}")
        n_points = stated
    scale = next(iter(point.numbers("SCALE")), 0.0) or scale
    if not np.isfinite(scale) or scale == 0:
        raise FormatError(path, "POINT:SCALE", "a number other than 0", scale)

    item = 4 if scale < 0 else 2
    n_items = 4 * n_points + n_analog
    offset = (words[8] - 1) * BLOCK
    if n_items and not 0 < offset <= len(raw):
        expected = f"data that begin within the file's {len(raw)} bytes"
        raise FormatError(path, "header, word 9", expected, f"byte {offset}")
    n_fit = (len(raw) - offset) // (n_items * item) if n_items else 0xFFFF
    first, n_frames, n_declared = _frames(path, groups, first, last, n_fit, warnings)
    truncated = ""
    if n_declared > n_frames:
        n_missing = offset + n_declared * n_items * item - len(raw)
        truncated = (
            f"cut off in frame {first + n_frames}: expected {n_declared} frames, found "
            f"{n_frames} complete, {n_missing} bytes are missing. Copy the file again."
        )
    values = _values(raw, offset, n_frames * n_items, item, processor).reshape(n_frames, n_items)
    points: NDArray[Any] = values[:, : 4 * n_points].reshape(n_frames, n_points, 4)
    analog: NDArray[Any] = values[:, 4 * n_points :]
    if item == 2:
        points = points.astype(np.float32)
        with np.errstate(over="ignore"):  # what overflows is not finite and so not seen
            points[..., :3] *= np.float32(scale)
        is_unsigned = groups.get("ANALOG", Group()).strings("FORMAT")[:1] == ["UNSIGNED"]
        analog = (analog.view(np.uint16) if is_unsigned else analog).astype(np.float32)
    return C3DFile(
        header=header,
        groups=groups,
        points=points,
        analog=analog,
        n_samples=words[9],
        first_frame=first,
        rate=_rate(rate, groups, words[9]),
        scale=abs(scale),
        warnings=tuple(warnings),
        truncated=truncated,
    )


def _parameters(raw: bytes, warnings: list[str]) -> tuple[int, dict[str, Group]]:
    """Read the processor and the groups of parameters up to the first damage."""
    at = (raw[0] - 1) * BLOCK
    processor = raw[at + 3] if 0 < at <= len(raw) - 4 else 0
    groups: dict[str, Group] = {}
    if processor in (INTEL, DEC, SGI):
        start = int.from_bytes(raw[16:18], "big" if processor == SGI else "little")
        end = (start - 1) * BLOCK if (start - 1) * BLOCK > at else len(raw)
        groups, problem = parse(raw[at + 4 : end], processor)
        if problem:
            warnings.append(f"damaged parameter section, read as far as it goes: {problem}")
    else:
        processor = INTEL
        warnings.append("the header points to no parameter section")
    if not groups:
        warnings.append("without parameters the points have neither names nor a unit")
    return processor, groups


def _values(raw: bytes, offset: int, n: int, item: int, processor: int) -> NDArray[Any]:
    """Decode n numbers of `item` bytes each; in Intel order as a view, without a copy."""
    if processor != INTEL:
        return decode(raw[offset : offset + n * item], item, processor)
    return np.frombuffer(raw, "<f4" if item == 4 else "<i2", n, offset if n else 0)


def _intel_header(header: bytes, processor: int) -> bytes:
    """Return the header with its words, reals and event times in Intel order."""
    if processor == INTEL:
        return header
    words = decode(header, 2, processor).tobytes()
    result = bytearray(words[:376] + header[376:])
    for begin, end in ((12, 16), (20, 24), (304, 376)):  # scale, rate, 18 event times
        result[begin:end] = decode(header[begin:end], 4, processor).tobytes()
    result[:2] = header[:2]
    return bytes(result)


def _rate(in_header: float, groups: dict[str, Group], n_samples: int) -> float:
    """Return the frame rate: POINT:RATE, else the header's, else by the analog channels, else 0."""
    analog = groups.get("ANALOG", Group()).numbers("RATE")
    candidates = [*groups.get("POINT", Group()).numbers("RATE")[:1], in_header]
    candidates += [r / n_samples for r in analog[:1] if n_samples]
    return next((r for r in candidates if np.isfinite(r) and 1e-6 < r < 1e9), 0.0)


def _frames(
    path: Path, groups: dict[str, Group], first: int, last: int, n_fit: int, warnings: list[str]
) -> tuple[int, int, int]:
    """Return the first frame, the number of complete frames, and the number of declared frames.

    The header's 16-bit words overflow at 65535, and each vendor stores longer counts elsewhere. Of
    several numbers that a file states, the first that fits its length is the declared one.
    """
    point, trial = groups.get("POINT", Group()), groups.get("TRIAL", Group())
    in_header = last - first + 1 if last >= first else 0
    claimed = point.counts("FRAMES")[:1]
    counts = [in_header]
    if last == 0xFFFF or claimed != counts:
        counts = [n for n in point.counts("LONG_FRAMES")[:1] if n]
        ends = [trial.counts(f"ACTUAL_{end}_FIELD") for end in ("START", "END")]
        if all(len(words) == 2 and max(words) <= 0xFFFF for words in ends):
            begin, stop = (low + 65536 * high for low, high in ends)
            if stop >= begin:
                first, counts = begin, [stop - begin + 1, *counts]
        if not counts and 0xFFFF in (*claimed, last) and n_fit > 0xFFFF + BLOCK:
            warnings.append("the number of frames is computed from the length of the file")
            counts = [n_fit]
        # 0xFFFF is where the words overflow: beside a longer count it says nothing.
        counts += [n for n in (*claimed, in_header) if n and not (n == 0xFFFF and counts)]
        counts = counts or [0]
    n_frames = next((n for n in counts if n <= n_fit), None)
    if n_frames is None and n_fit == 0:
        raise FormatError(
            path, f"frame {first}", f"{counts[0]} frames of data",
            "the end of the file before the first is complete",
            "the file is cut off: copy it again",
        )  # fmt: skip
    if n_frames is None:
        return first, n_fit, counts[0]
    if n_frames != counts[0]:
        warnings.append(f"{n_frames} frames are read: the file is too short for {counts[0]}")
    elif n_frames != in_header and last < 0xFFFF:
        warnings.append(f"{n_frames} frames are read; the header states {in_header}")
    if n_frames == 0:
        warnings.append("the file has no frames")
    return first, n_frames, n_frames
