"""Who wins where, of the rows of `field.py`: the best peer beside ours, line by line."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np

from field_rows import NOT_RUN, ORACLES, OURS
from peers import PEERS
from report import table

if TYPE_CHECKING:
    from collections.abc import Sequence

    from field_rows import Found, Score

__all__ = ["verdict"]

EQUAL = 0.002
"""Values of IDF1 that differ by less are the same, here."""


def value(scores: Sequence[Score]) -> float:
    """Give the mean IDF1; nan where not every clip was run."""
    if any(s.error == NOT_RUN for s in scores) or all(s.error for s in scores):
        return np.nan
    return float(np.mean([s.idf1 for s in scores]))


def best(names: Sequence[str], kind: str, found: Found) -> str:
    """Give the one of the greatest IDF1, of equal ones that of the fewest switches."""
    known = [n for n in names if (kind, n) in found and not np.isnan(value(found[kind, n]))]
    return max(known, key=lambda n: (round(value(found[kind, n]), 4), -switches(kind, n, found)))


def switches(kind: str, name: str, found: Found) -> float:
    """Give the mean for 1000 detections over the clips that it finished."""
    return float(np.nanmean([s.switches for s in found[kind, name] if not s.error]))


def fewer(peer: float, ours: float, oracle: float) -> str:
    """Say how many times fewer switches ours have than a peer, beyond what the oracle forces."""
    theirs, own = max(peer - oracle, 0.0), max(ours - oracle, 0.0)
    if theirs < 0.005:
        return "none to save"
    return "all of them" if own < 0.005 else f"{theirs / own:.1f} ×"


def verdict(kinds: Sequence[str], found: Found) -> list[str]:
    """Give the table of all kinds, with a word on each goal."""
    oracle_name = list(ORACLES)[-1]
    rows: list[list[str]] = []
    for kind in kinds:
        peers = [n for n in PEERS if not np.isnan(value(found.get((kind, n), ())))]
        ours = [n for n in OURS if not np.isnan(value(found.get((kind, n), ())))]
        if not peers or "auto" not in ours or (kind, oracle_name) not in found:
            continue  # a part was asked for, or is missing
        peer, own = best(peers, kind, found), best(ours, kind, found)
        theirs, auto = value(found[kind, peer]), value(found[kind, "auto"])
        top = max(theirs, value(found[kind, own]))
        equal = [n for n in (*peers, *ours) if value(found[kind, n]) >= top - EQUAL]
        fastest = min(equal, key=lambda n: time(kind, n, found))
        oracle = switches(kind, oracle_name, found)
        of_peer, of_auto = switches(kind, peer, found), switches(kind, "auto", found)
        word = "equal" if abs(auto - theirs) < EQUAL else "auto" if auto > theirs else peer
        rows.append([
            kind, f"{peer} {theirs:.4f}", f"{auto:.4f}", f"{own} {value(found[kind, own]):.4f}",
            word, f"{of_peer:.2f}", f"{of_auto:.2f}", f"{oracle:.2f}",
            fewer(of_peer, of_auto, oracle), f"{fastest} {time(kind, fastest, found):.2f} ms",
        ])  # fmt: skip
    head = [
        "", "best peer, IDF1", "auto, IDF1", "best of ours, IDF1", "ahead by > 0.002",
        "switches a 1000: best peer", "auto", "oracle", "auto has fewer", "fastest of the best",
    ]  # fmt: skip
    return table(head, rows)


def time(kind: str, name: str, found: Found) -> float:
    """Give the mean milliseconds a frame."""
    return float(np.mean([s.ms for s in found[kind, name] if not s.error]))
