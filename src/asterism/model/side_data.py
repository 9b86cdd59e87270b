"""What a laboratory records beside the points: analog channels, events, force plates."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np

from asterism.records import record

if TYPE_CHECKING:
    from numpy.typing import NDArray

__all__ = ["Analog", "Event", "ForcePlate"]


@record(eq=False)
class Analog:
    """Analog channels of a capture: ``capture.analog["Fz1"]``.

    Parameters
    ----------
    names : tuple of str
        Name of each of the A channels.
    units : tuple of str
        Unit of each channel as the file states it, "" where it does not.
    rate : float
        Samples a second. The first sample is of the first frame of the file.
    stored : ndarray, shape (S, A)
        Samples as the file stores them.
    offset, scale : ndarray, shape (A,)
        A value is ``(stored - offset) * scale``.
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
    """A moment that the file marks.

    Parameters
    ----------
    time : float
        Seconds from the first frame of the file.
    label : str
        What happened, "Foot Strike" for example.
    context : str
        Of what, "Left" for example; "" where the file does not say.
    """

    time: float
    label: str
    context: str = ""


@record(eq=False)
class ForcePlate:
    """A force plate.

    Parameters
    ----------
    kind : int
        FORCE_PLATFORM:TYPE of the C3D file, which says what its channels measure.
    corners : ndarray, shape (4, 3)
        Corners of the working surface, metres.
    origin : ndarray, shape (3,)
        From the middle of the surface to the origin of the sensors, in the plate's axes, metres.
    channels : tuple of str
        Its analog channels, in the order that `kind` prescribes.
    """

    kind: int
    corners: NDArray[np.float64]
    origin: NDArray[np.float64]
    channels: tuple[str, ...]

    def __repr__(self) -> str:
        x, y = np.ptp(self.corners[:, :2], axis=0)
        return f"ForcePlate(type {self.kind}, {x:.3g} × {y:.3g} m, {len(self.channels)} channels)"
