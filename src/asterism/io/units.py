"""Units of length in files, and metres in memory.

Numbers of files are divided by the units per metre and never multiplied by an inexact 0.001. So
the conversion back restores the same float32, bit for bit, and the same decimal text.
"""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np

from asterism.errors import ParameterError

if TYPE_CHECKING:
    from numpy.typing import NDArray

__all__ = ["PER_METRE", "check_size", "from_metres", "judge_unit", "parse_unit", "to_float32"]

PER_METRE = {"mm": 1000.0, "cm": 100.0, "m": 1.0, "in": 1 / 0.0254, "ft": 1 / 0.3048}
_SPELLINGS = {
    **dict.fromkeys(("mm", "millimeter", "millimeters", "millimetre", "millimetres"), "mm"),
    **dict.fromkeys(("cm", "centimeter", "centimeters", "centimetre", "centimetres"), "cm"),
    **dict.fromkeys(("m", "meter", "meters", "metre", "metres"), "m"),
    **dict.fromkeys(("in", "inch", "inches"), "in"),
    **dict.fromkeys(("ft", "foot", "feet"), "ft"),
}
_NEAREST, _FARTHEST = 0.02, 100.0
"""Plausible limits, in metres, of the 90th percentile of the points' largest coordinates."""
_MOST_POINTS = 100_000  # evenly spaced points that are examined


def parse_unit(text: str) -> str | None:
    """Return a key of `PER_METRE` for its spelling in a file, None for anything else.

    Examples
    --------
    >>> [parse_unit(text) for text in ("Millimeters", "INCH", "feet", "furlong")]
    ['mm', 'in', 'ft', None]
    """
    return _SPELLINGS.get(text.strip().lower())


def judge_unit(points: NDArray[np.floating]) -> str:
    """Estimate whether coordinates without a unit are metres or millimetres.

    Parameters
    ----------
    points : ndarray of shape (N, D)
        Coordinates of the file, all finite.

    Returns
    -------
    {"mm", "m"}
        "mm" if a tenth of the points are more than 20 units from the origin. Few laboratories are
        larger than 20 metres, and few captures are smaller than 20 millimetres.
    """
    if not len(points):
        return "mm"
    return "mm" if _reach(points) > 20 else "m"


def check_size(points: NDArray[np.floating], unit: str) -> tuple[str, ...]:
    """Warn of metres that a file labels as millimetres, and of the reverse.

    Parameters
    ----------
    points : ndarray of shape (N, D)
        Metres, converted from the file's unit.
    unit : str
        Unit of the file.

    Returns
    -------
    tuple of str
        One warning if the size is implausible and a factor of 1000 makes it plausible, else none.

    Examples
    --------
    >>> check_size(np.array([[0.9, 1.1, 0.4]]), "mm")
    ()
    >>> check_size(np.array([[0.0009, 0.0011, 0.0004]]), "mm")[0][:71]
    'unit of length: expected coordinates in mm, the unit of the file, found'
    """
    if not len(points):
        return ()
    far = _reach(points[:: -(-len(points) // _MOST_POINTS)])
    if unit == "mm" and far < _NEAREST <= 1000 * far:
        other = "m"
    elif unit == "m" and far > _FARTHEST >= far / 1000:
        other = "mm"
    else:
        return ()
    return (
        f"unit of length: expected coordinates in {unit}, the unit of the file, found the size of "
        f"coordinates in {other} (nine tenths of the points lie within {far * PER_METRE[unit]:.3g} "
        f"{unit} of the origin). Correct the unit in the file.",
    )


def _reach(points: NDArray[np.floating]) -> float:
    """Return the 90th percentile of the points' largest coordinates."""
    return float(np.quantile(np.abs(points).max(axis=1), 0.9))


def from_metres(metres: NDArray[np.float64], unit: str) -> NDArray[np.float64]:
    """Convert metres to a unit, so that the conversion back restores the same metres.

    The result is the double next to the product that divides back to the input, with the fewest
    decimals. If there is none (the input did not come from a file in this unit), the result is the
    product, which divides back to within one unit in the last place.

    Parameters
    ----------
    metres : ndarray
        Lengths in metres; NaN stays NaN.
    unit : str
        Key of `PER_METRE`.

    Returns
    -------
    ndarray
        Lengths in the unit.

    Examples
    --------
    >>> 0.000123 * 1000, float(from_metres(np.array([0.000123]), "mm")[0])
    (0.12300000000000001, 0.123)
    """
    per_metre = PER_METRE[unit]
    if per_metre == 1.0:
        return metres
    product = metres * per_metre
    result = product.copy()
    is_open = np.isfinite(metres)
    for candidate in (
        np.round(product, 6),
        np.round(product, 9),
        product,
        np.nextafter(product, np.inf),
        np.nextafter(product, -np.inf),
    ):
        fits = is_open & (candidate / per_metre == metres)
        result[fits] = candidate[fits]
        is_open &= ~fits
    return result


def to_float32(values: NDArray[np.float64]) -> NDArray[np.float32]:
    """Round to 32-bit floats of about 7 digits; NaN stays NaN.

    Raises
    ------
    ParameterError
        If a number is larger than the largest 32-bit float.
    """
    with np.errstate(over="ignore"):
        rounded = values.astype("<f4")
    if np.isinf(rounded).any():
        largest = np.nanmax(np.abs(values))
        raise ParameterError("points", "coordinates that 32-bit floats can hold", f"{largest:g}")
    return rounded
