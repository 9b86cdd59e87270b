"""Source: a stream of the Lab Streaming Layer with three channels a point."""

from __future__ import annotations

import time
from typing import TYPE_CHECKING, Any

import numpy as np

from asterism.errors import SourceError, SourceLost
from asterism.live.frame import SourceFrame

if TYPE_CHECKING:
    from numpy.typing import NDArray

__all__ = ["LslSource", "imported"]

_RESOLVE_SECONDS = 5.0
_PER_METRE = {"mm": 1000.0, "millimeters": 1000.0, "millimetres": 1000.0, "cm": 100.0}


class LslSource:
    """Source of the points of a stream: x, y and z of each, NaN where it is missing.

    Parameters
    ----------
    name : str
        The source, as the user wrote it.
    stream : str
        Name of the stream.
    """

    def __init__(self, name: str, stream: str) -> None:
        self.name, self._stream = name, stream
        self.rate = 0.0
        self.waits = False
        self.faults: dict[str, int] = {}
        self._inlet: Any = None
        self._number = 0
        self._per_metre = 1.0

    def open(self) -> None:
        """Find the stream and subscribe.

        Raises
        ------
        SourceError
            If pylsl is missing, there is no such stream, or it has not three channels a point.
        """
        pylsl = imported(SourceError)
        self.close()
        found = pylsl.resolve_byprop("name", self._stream, minimum=1, timeout=_RESOLVE_SECONDS)
        if not found:
            others = ", ".join(sorted({s.name() for s in pylsl.resolve_streams(wait_time=0.5)}))
            hint = f"Available: {others}" if others else "No stream is available"
            raise SourceError(f"{self.name}: no stream of this name. {hint}.")
        n = found[0].channel_count()
        if n % 3 or not n:
            raise SourceError(f"{self.name}: expected three channels a point, found {n} channels.")
        self._inlet = pylsl.StreamInlet(found[0], max_buflen=2, recover=False)
        info = self._inlet.info(timeout=_RESOLVE_SECONDS)
        self.rate = max(0.0, info.nominal_srate())
        unit = info.desc().child("channels").child("channel").child_value("unit").lower()
        self._per_metre = _PER_METRE.get(unit, 1.0)
        self._inlet.open_stream(timeout=_RESOLVE_SECONDS)

    def receive(self, timeout: float) -> SourceFrame | None:
        """Wait for the next frame.

        Raises
        ------
        SourceLost
            If the stream is gone.
        """
        if self._inlet is None:
            raise SourceLost("the source is not open.")
        try:
            sample, stamp = self._inlet.pull_sample(timeout=timeout)
        except Exception as error:  # pylsl has no common class of errors
            self.close()
            raise SourceLost(f"the stream is lost: {error}.") from error
        arrived = time.perf_counter()
        if sample is None:
            return None
        self._number += 1
        places: NDArray[np.float64] = np.array(sample, dtype=np.float64).reshape(-1, 3)
        return SourceFrame(
            number=self._number,
            time=float(stamp),
            points=places[~np.isnan(places).all(axis=1)] / self._per_metre,
            received=arrived,
        )

    def close(self) -> None:
        """Unsubscribe."""
        if self._inlet is not None:
            self._inlet.close_stream()
            self._inlet = None


def imported(error: type[Exception]) -> Any:
    """Return pylsl, or raise an error that says how to install it."""
    try:
        import pylsl
    except (ImportError, RuntimeError) as cause:  # a RuntimeError where liblsl is missing
        hint = "Run pip install 'asterism[live]'"
        raise error(f"lsl: pylsl, which is optional, is not installed. {hint}.") from cause
    return pylsl
