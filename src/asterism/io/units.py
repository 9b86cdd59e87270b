"""Units of length in files, and metres in memory.

Files are divided by their units per metre and never multiplied by an inexact 0.001: then the way
back gives the same float32, bit for bit, and the same decimal text.
"""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np

from asterism.errors import ParameterError

if TYPE_CHECKING:
    from numpy.typing import NDArray

__all__ = ["PER_METRE", "from_metres", "judge_unit", "parse_unit", "to_float32"]

PER_METRE = {"mm": 1000.0, "cm": 100.0, "m": 1.0}
_SPELLINGS = {
    **dict.fromkeys(("mm", "millimeter", "millimeters", "millimetre", "millimetres"), "mm"),
    **dict.fromkeys(("cm", "centimeter", "centimeters", "centimetre", "centimetres"), "cm"),
    **dict.fromkeys(("m", "meter", "meters", "metre", "metres"), "m"),
}


def parse_unit(text: str) -> str | None:
    """Give "mm", "cm" or "m" for its spelling in a file, None for anything else."""
    return _SPELLINGS.get(text.strip().lower())


def judge_unit(points: NDArray[np.floating]) -> str:
    """Guess whether coordinates without a unit are metres or millimetres.

    Parameters
    ----------
    points : ndarray, shape (N, D)
        Coordinates as they stand in the file, all finite.

    Returns
    -------
    {"mm", "m"}
        "mm" if a tenth of the points are more than 20 units from the origin: no laboratory is that
        large in metres, and hardly anything lies within 20 millimetres.
    """
    if not len(points):
        return "mm"
    far = np.quantile(np.abs(points).max(axis=1), 0.9)
    return "mm" if far > 20 else "m"


def from_metres(metres: NDArray[np.float64], unit: str) -> NDArray[np.float64]:
    """Convert metres to a unit, so that dividing again gives the same metres.

    Among the doubles next to the product, the roundest that divides back to the input is taken;
    where there is none (the input did not come from a file in this unit) the product, which
    divides back to within one unit in the last place.

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
    """Round to 32 bits, which hold 7 digits; NaN stays.

    Raises
    ------
    ParameterError
        At a number that 32 bits cannot hold.
    """
    with np.errstate(over="ignore"):
        rounded = values.astype("<f4")
    if np.isinf(rounded).any():
        largest = np.nanmax(np.abs(values))
        raise ParameterError("points", "coordinates that 32-bit floats can hold", f"{largest:g}")
    return rounded
