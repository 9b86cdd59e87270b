"""Counts of what goes wrong in a stream; each reason is logged once."""

from __future__ import annotations

import logging
from collections import Counter

__all__ = ["Faults"]

log = logging.getLogger(__name__)


class Faults:
    """Number of occurrences of each fault.

    Parameters
    ----------
    name : str
        Name of the source, for the log.

    Examples
    --------
    >>> faults = Faults("udp://127.0.0.1:5000")
    >>> faults.add("lost", "frames are missing", 3)
    >>> faults.add("lost", "frames are missing")
    >>> faults.counts
    Counter({'lost': 4})
    """

    def __init__(self, name: str) -> None:
        self._name = name
        self.counts: Counter[str] = Counter()

    def undecoded(self, error: Exception) -> None:
        """Count a packet that a source cannot decode."""
        self.add("undecoded", f"a packet cannot be decoded and is ignored ({error})")

    def add(self, kind: str, reason: str, n: int = 1) -> None:
        """Count a fault, and log its reason at the first time.

        Parameters
        ----------
        kind : str
            Kind of fault, one word.
        reason : str
            What is wrong and what follows, for the log.
        n : int
            Number of occurrences.
        """
        if kind not in self.counts:
            log.warning("%s: %s. Further ones are counted as %r.", self._name, reason, kind)
        self.counts[kind] += n
