"""A frame as the servers send it: labelled markers in a fixed order, and other points."""

from __future__ import annotations

from typing import TYPE_CHECKING

from asterism.records import record

if TYPE_CHECKING:
    from collections.abc import Sequence

    import numpy as np
    from numpy.typing import NDArray

__all__ = ["ServedFrame"]


@record(eq=False)
class ServedFrame:
    """One frame of a server.

    Parameters
    ----------
    number : int
        Frame number.
    time : float
        Seconds since the start of the measurement.
    markers : ndarray of shape (K, 3)
        Labelled markers in the order of the server's names, metres; NaN for a missing marker.
    points : ndarray of shape (N, 3)
        Points without a name, metres.
    ids : ndarray of int, shape (N,)
        Number that identifies each such point between frames; 0 for none.
    images : sequence of ndarray, each of shape (n, 2), optional
        Image points of each camera of the server, pixels.

    Examples
    --------
    >>> import numpy as np
    >>> markers, points = np.zeros((2, 3)), np.ones((1, 3))
    >>> ServedFrame(number=1, time=0.01, markers=markers, points=points, ids=np.array([7]))
    ServedFrame(number=1, time=0.01, markers=array (2, 3), points=array (1, 3), ids=[7])
    """

    number: int
    time: float
    markers: NDArray[np.float64]
    points: NDArray[np.float64]
    ids: NDArray[np.int64]
    images: Sequence[NDArray[np.float64]] | None = None
