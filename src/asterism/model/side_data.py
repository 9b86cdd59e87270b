"""Further data of a capture: analog channels, events and force plates."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np

from asterism.records import record

if TYPE_CHECKING:
    from numpy.typing import NDArray

__all__ = ["Analog", "Event", "ForcePlate"]


@record(eq=False)
class Analog:
    """Analog channels of a capture, read by name: ``capture.analog["Fz1"]``.

    Parameters
    ----------
    names : tuple of str
        Name of each of the A channels.
    units : tuple of str
        Unit of each channel as stated in the file, "" if the file states none.
    rate : float
        Samples per second. The first sample belongs to the first frame of the file.
    stored : ndarray of shape (S, A)
        Samples as the file stores them.
    offset, scale : ndarray of shape (A,)
        Conversion of the stored samples: a value is ``(stored - offset) * scale``.

    Examples
    --------
    >>> import asterism as am
    >>> stored = np.array([[0.0], [2.0]], dtype=np.float32)
    >>> analog = am.model.Analog(
    ...     names=("Fz1",), units=("N",), rate=1000.0, stored=stored,
    ...     offset=np.array([1.0]), scale=np.array([0.5]),
    ... )
    >>> analog["Fz1"]
    array([-0.5,  0.5])
    >>> analog.n_samples, analog.times
    (2, array([0.   , 0.001]))
    """

    names: tuple[str, ...]
    units: tuple[str, ...]
    rate: float
    stored: NDArray[np.float32]
    offset: NDArray[np.float64]
    scale: NDArray[np.float64]

    @property
    def n_samples(self) -> int:
        """Number of samples S of each channel."""
        return len(self.stored)

    @property
    def times(self) -> NDArray[np.float64]:
        """Time of each sample, seconds from the first frame of the file, shape (S,)."""
        return np.arange(self.n_samples) / self.rate

    def __len__(self) -> int:
        """Return the number of channels."""
        return len(self.names)

    def __getitem__(self, name: str) -> NDArray[np.float64]:
        """Return the values of a channel in its unit, shape (S,).

        Raises
        ------
        KeyError
            If there is no channel of that name.
        """
        if name not in self.names:
            raise KeyError(f"no analog channel {name!r}: {', '.join(self.names)}")
        k = self.names.index(name)
        return (self.stored[:, k].astype(np.float64) - self.offset[k]) * self.scale[k]

    def __repr__(self) -> str:
        return f"Analog({len(self)} channels, {self.n_samples} samples, {self.rate:g} Hz)"


@record
class Event:
    """Event marked in a capture file, such as a foot strike.

    Parameters
    ----------
    time : float
        Seconds from the first frame of the file.
    label : str
        Kind of event, for example "Foot Strike".
    context : str
        Side or subject, for example "Left"; "" if the file states none.

    Examples
    --------
    >>> import asterism as am
    >>> am.model.Event(time=1.25, label="Foot Strike", context="Left")
    Event(time=1.25, label='Foot Strike', context='Left')
    """

    time: float
    label: str
    context: str = ""


@record(eq=False)
class ForcePlate:
    """Force plate of a capture: its kind, its place and its analog channels.

    Parameters
    ----------
    kind : int
        FORCE_PLATFORM:TYPE of the C3D file, which defines what the channels measure.
    corners : ndarray of shape (4, 3)
        Corners of the working surface, metres.
    origin : ndarray of shape (3,)
        Vector from the centre of the surface to the sensors' origin, in the plate's axes, metres.
    channels : tuple of str
        Names of its analog channels, in the order prescribed by `kind`.

    Examples
    --------
    >>> import asterism as am
    >>> corners = np.array([[0, 0, 0], [0.5, 0, 0], [0.5, 0.4, 0], [0, 0.4, 0]])
    >>> plate = am.model.ForcePlate(
    ...     kind=2, corners=corners, origin=np.zeros(3), channels=("Fx1", "Fy1", "Fz1"))
    >>> plate.channels
    ('Fx1', 'Fy1', 'Fz1')
    """

    kind: int
    corners: NDArray[np.float64]
    origin: NDArray[np.float64]
    channels: tuple[str, ...]

    def __repr__(self) -> str:
        x, y = np.ptp(self.corners[:, :2], axis=0)
        return f"ForcePlate(type {self.kind}, {x:.3g} × {y:.3g} m, {len(self.channels)} channels)"
