"""Histogram of latencies in constant memory."""

from __future__ import annotations

import math

__all__ = ["LatencyHistogram"]

_FIRST, _DECADES, _PER_DECADE = 1e-5, 6, 40


class LatencyHistogram:
    """Counts of durations in classes that are equally wide on a logarithmic scale.

    A class is 6 % wide, from 10 µs to 10 s; shorter and longer durations are counted in the first
    and the last class. Memory does not grow with the number of durations.

    Examples
    --------
    >>> latency = LatencyHistogram()
    >>> for ms in range(1, 101):
    ...     latency.add(ms / 1000)
    >>> latency, round(latency.quantile(0.5), 3), latency.longest
    (LatencyHistogram(100 frames, median 50.1 ms, p99 100 ms), 0.05, 0.1)
    """

    def __init__(self) -> None:
        self.counts = [0] * (_DECADES * _PER_DECADE + 1)
        self.n, self.longest = 0, 0.0

    def __repr__(self) -> str:
        middle, late = (f"{1e3 * self.quantile(q):.3g} ms" for q in (0.5, 0.99))
        return f"LatencyHistogram({self.n} frames, median {middle}, p99 {late})"

    def add(self, seconds: float) -> None:
        """Count a duration.

        Parameters
        ----------
        seconds : float
            Duration, seconds, ≥ 0.
        """
        place = int(_PER_DECADE * math.log10(seconds / _FIRST)) + 1 if seconds >= _FIRST else 0
        self.counts[min(place, len(self.counts) - 1)] += 1
        self.n += 1
        self.longest = max(self.longest, seconds)

    def quantile(self, share: float) -> float:
        """Return the duration that this share of all does not exceed.

        Parameters
        ----------
        share : float
            Share, 0 to 1.

        Returns
        -------
        float
            Upper end of the class, at most the longest duration, seconds; nan without durations.
        """
        if self.n == 0:
            return math.nan
        left = share * self.n
        for place, count in enumerate(self.counts):
            left -= count
            if left <= 1e-9 and place < len(self.counts) - 1:
                return min(_FIRST * 10 ** (place / _PER_DECADE), self.longest)
        return self.longest

    def classes(self) -> list[tuple[float, int]]:
        """Return upper end, seconds, and count of the classes that are not empty."""
        return [
            (_FIRST * 10 ** (place / _PER_DECADE), count)
            for place, count in enumerate(self.counts)
            if count
        ]
