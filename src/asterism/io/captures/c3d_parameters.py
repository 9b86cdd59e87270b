"""Parameter section of a C3D file: groups of named values, parsed and built.

Values are kept as bytes in Intel order, so that unknown parameters are written again unchanged.
"""

from __future__ import annotations

import math
from dataclasses import dataclass, field
from typing import TYPE_CHECKING, Self

import numpy as np

from asterism.errors import ParameterError

if TYPE_CHECKING:
    from collections.abc import Sequence

    from numpy.typing import NDArray

__all__ = ["BLOCK", "DEC", "INTEL", "SGI", "Group", "Parameter", "build", "decode", "parse"]

BLOCK = 512
INTEL, DEC, SGI = 84, 85, 86
# Groups that the reader interprets; their names and those of their parameters are in capitals.
_SPOKEN = ("POINT", "ANALOG", "TRIAL")
_TEXT, _BYTE, _INTEGER, _REAL = -1, 1, 2, 4


def decode(raw: bytes, kind: int, processor: int) -> NDArray[np.generic]:
    """Decode integers or reals of one of the three processor types.

    Parameters
    ----------
    raw : bytes
        Bytes of the file.
    kind : int
        2 for 16-bit integers, 4 for 32-bit reals.
    processor : int
        84 Intel, 85 DEC (little-endian integers, VAX reals), 86 SGI/MIPS (big-endian).

    Returns
    -------
    ndarray
        int16 or float32; for Intel a view of `raw`.
    """
    order = ">" if processor == SGI else "<"
    if kind == _INTEGER:
        return np.frombuffer(raw, dtype=f"{order}i2").astype("<i2", copy=False)
    if processor == DEC:
        # VAX F: the two 16-bit words are swapped, and the bias of the exponent is larger by 2.
        words = np.frombuffer(raw, dtype="<u2").reshape(-1, 2)[:, ::-1]
        with np.errstate(invalid="ignore"):
            return np.ascontiguousarray(words).view("<f4").ravel() / np.float32(4)
    return np.frombuffer(raw, dtype=f"{order}f4").astype("<f4", copy=False)


@dataclass(frozen=True)
class Parameter:
    """Value of a parameter.

    Parameters
    ----------
    kind : {-1, 1, 2, 4}
        Text, bytes, 16-bit integers or 32-bit reals.
    dims : tuple of int
        Dimensions, the fastest first; of texts the first is their length.
    data : bytes
        Values in Intel order.
    description : bytes
        Description of the parameter.
    locked : bool
        Whether the file marks the parameter as locked.
    """

    kind: int
    dims: tuple[int, ...]
    data: bytes
    description: bytes = b""
    locked: bool = False

    def strings(self) -> list[str]:
        """Return the texts without padding, as UTF-8 or else Latin-1; empty if not text."""
        if self.kind != _TEXT:
            return []
        width = self.dims[0] if self.dims else 1
        # Texts of length 0 take no bytes, so a few dimensions could claim billions of them.
        n = math.prod(self.dims[1:]) if width else math.prod(self.dims[1:2])
        return [_text(self.data[i * width : (i + 1) * width]) for i in range(n)]

    def numbers(self) -> list[float]:
        """Return the values as numbers, integers as unsigned counts; empty if not numeric."""
        if self.kind == _TEXT:
            return []
        kind = {_BYTE: "u1", _INTEGER: "<u2", _REAL: "<f4"}[self.kind]
        with np.errstate(invalid="ignore"):  # a signalling NaN becomes a quiet one
            return np.frombuffer(self.data, dtype=kind).astype(np.float64).tolist()

    @classmethod
    def of_strings(cls, texts: Sequence[str], like: Parameter | None = None) -> Self:
        """Build a parameter of at most 255 texts of at most 255 bytes each."""
        raw = [text.encode() for text in texts]
        width = max(map(len, raw), default=0)
        if width > 255:
            longest = max(texts, key=lambda text: len(text.encode()))
            raise ParameterError("names", "at most 255 bytes a name in a C3D", repr(longest))
        data = b"".join(text.ljust(width) for text in raw)
        old = like or cls(_TEXT, (), b"")
        return cls(_TEXT, (width, len(raw)), data, old.description, old.locked)

    @classmethod
    def of_integers(cls, values: Sequence[int], like: Parameter | None = None) -> Self:
        """Build a parameter of one 16-bit integer, or of a list of them."""
        dims = () if len(values) == 1 else (len(values),)
        old = like or cls(_INTEGER, (), b"")
        data = np.array(values, dtype="<u2").tobytes()
        return cls(_INTEGER, dims, data, old.description, old.locked)

    @classmethod
    def of_reals(cls, values: Sequence[float], like: Parameter | None = None) -> Self:
        """Build a parameter of one 32-bit real, or of a list of them."""
        dims = () if len(values) == 1 else (len(values),)
        old = like or cls(_REAL, (), b"")
        data = np.array(values, dtype="<f4").tobytes()
        return cls(_REAL, dims, data, old.description, old.locked)


@dataclass
class Group:
    """Group of parameters.

    Parameters
    ----------
    parameters : dict of str to Parameter
        Parameters by name, in the order of the file.
    description : bytes
        Description of the group.
    locked : bool
        Whether the file marks the group as locked.
    """

    parameters: dict[str, Parameter] = field(default_factory=dict[str, Parameter])
    description: bytes = b""
    locked: bool = False

    def strings(self, name: str) -> list[str]:
        """Return the texts of a parameter, [] if there is none."""
        return self.parameters[name].strings() if name in self.parameters else []

    def numbers(self, name: str) -> list[float]:
        """Return the numbers of a parameter, [] if there is none."""
        return self.parameters[name].numbers() if name in self.parameters else []

    def counts(self, name: str) -> list[int]:
        """Return the non-negative whole numbers of a parameter."""
        return [int(n) for n in self.numbers(name) if 0 <= n < 2**31]


def _text(raw: bytes) -> str:
    raw = raw.split(b"\0")[0].rstrip()
    try:
        return raw.decode()
    except UnicodeDecodeError:
        return raw.decode("latin-1")


def parse(section: bytes, processor: int) -> tuple[dict[str, Group], str]:
    """Parse groups and parameters up to the first damage.

    Parameters
    ----------
    section : bytes
        Parameter section without its four leading bytes.
    processor : int
        Processor type of its numbers, see `decode`.

    Returns
    -------
    groups : dict of str to Group
        Groups by name.
    problem : str
        Place and reason of an early stop, "" if there was none.
    """
    groups: dict[int, tuple[str, Group]] = {}
    parameters: list[tuple[int, str, str, Parameter]] = []
    size, at = len(section), 0
    problem = ""
    order = "big" if processor == SGI else "little"
    while at + 2 <= size:
        n_name = int.from_bytes(section[at : at + 1], signed=True)
        number = int.from_bytes(section[at + 1 : at + 2], signed=True)
        if n_name == 0 or number == 0:
            break
        p = at + 2 + abs(n_name)
        step = int.from_bytes(section[p : p + 2], order)
        following = p + step if step else size
        # A record without a successor may be any length up to the end of the section.
        if p + 3 > size or following > size or 0 < step < 3:
            problem = f"byte {at}: a record of {abs(n_name)} + {step} bytes in {size - at}"
            break
        name = section[at + 2 : p].decode("latin-1").strip()
        capitals = section[at + 2 : p].upper().decode("latin-1").strip()  # of ASCII letters only
        body = section[p + 2 : following]
        if number < 0:
            name = capitals if capitals in _SPOKEN else name
            description = body[1 : 1 + body[0]]
            groups[-number] = name, Group({}, description, n_name < 0)
        else:
            parameter = _parse_parameter(body, processor, n_name < 0)
            if parameter is None:
                problem = f"byte {at}: parameter {name} is larger than its record"
            else:
                parameters.append((number, name, capitals, parameter))
                if step and len(body) < 3 + len(parameter.dims) + len(parameter.data):
                    problem = problem or f"byte {at}: {name} ends before its description"
        at = following
    for number, name, capitals, parameter in parameters:
        if number in groups:
            group_name, group = groups[number]
            group.parameters[capitals if group_name in _SPOKEN else name] = parameter
        else:
            problem = problem or f"parameter {name} belongs to group {number}, which is not there"
    return dict(groups.values()), problem


def _parse_parameter(body: bytes, processor: int, locked: bool) -> Parameter | None:
    kind = int.from_bytes(body[:1], signed=True)
    n_dims = body[1] if len(body) > 1 else 0
    dims = tuple(body[2 : 2 + n_dims])
    start = 2 + n_dims
    end = start + math.prod(dims) * abs(kind)
    if kind not in (_TEXT, _BYTE, _INTEGER, _REAL) or len(dims) < n_dims or end > len(body):
        return None
    data = body[start:end]
    if kind in (_INTEGER, _REAL) and processor != INTEL:
        data = decode(data, kind, processor).tobytes()
    n_description = body[end] if end < len(body) else 0
    return Parameter(kind, dims, data, body[end + 1 : end + 1 + n_description], locked)


def build(groups: dict[str, Group]) -> bytes:
    """Build the parameter section with its four leading bytes, padded to full blocks.

    Parameters
    ----------
    groups : dict of str to Group
        Groups by name.

    Returns
    -------
    bytes
        Parameter section.

    Raises
    ------
    ParameterError
        If the section is longer than the 255 blocks that the format can count.
    """
    records: list[bytes] = []
    for number, (name, group) in enumerate(groups.items(), start=1):
        body = bytes([len(group.description)]) + group.description
        records.append(_record(name, -number, group.locked, body))
        for key, p in group.parameters.items():
            body = bytes([p.kind & 0xFF, len(p.dims), *p.dims])
            body += p.data + bytes([len(p.description)]) + p.description
            records.append(_record(key, number, p.locked, body))
    # The terminator: a name of no characters.
    section = b"".join(records) + b"\0\0"
    n_blocks = -(-(len(section) + 4) // BLOCK)
    if n_blocks > 255:
        raise ParameterError(
            "tracks", "names that fit the 130 kB that a C3D has for parameters",
            f"{len(section) / 1000:.0f} kB of names and parameters",
            "write CSV, or drop short tracks first",
        )  # fmt: skip
    return (bytes([1, 0x50, n_blocks, INTEL]) + section).ljust(n_blocks * BLOCK, b"\0")


def _record(name: str, number: int, locked: bool, body: bytes) -> bytes:
    raw = name.encode("latin-1")
    if len(body) + 2 > 0xFFFF:
        got = f"{len(body)} bytes"
        raise ParameterError(f"the C3D parameter {name}", "at most 65 kB", got, "write CSV")
    head = bytes([(-len(raw) if locked else len(raw)) & 0xFF, number & 0xFF])
    return head + raw + (len(body) + 2).to_bytes(2, "little") + body
