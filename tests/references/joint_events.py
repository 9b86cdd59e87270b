"""Joint events by plain enumeration and, of a chain, by transfer matrices."""

from __future__ import annotations

import math

import numpy as np

from tests.references.assignment import every_choice


def every_event(log_weights, log_miss):
    """All joint events of some weight: detection of each track, -1 for a miss; logs of factors."""
    rows = [[none, *row] for none, row in zip(log_miss.tolist(), log_weights.tolist(), strict=True)]
    options = [[j - 1 for j, factor in enumerate(row) if factor > -math.inf] for row in rows]
    events = every_choice(options)
    return events, [[row[j + 1] for row, j in zip(rows, event, strict=True)] for event in events]


def enumerate_events(log_weights, log_miss):
    """Marginals with the miss last, log of the total weight, log of the greatest weight."""
    n, m = log_weights.shape
    events, factors = every_event(log_weights, log_miss)
    best = max(factors, key=math.fsum)
    top = math.fsum(best)
    # Every difference as one exact sum, so that great logs cost no precision.
    weights = [math.exp(math.fsum([*terms, *(-x for x in best)])) for terms in factors]
    total = math.fsum(weights)
    marginals = np.zeros((n, m + 1))
    for event, weight in zip(events, weights, strict=True):
        for i, j in enumerate(event):
            marginals[i, j] += weight / total
    return marginals, top + math.log(total), top


def chain_events(left, right, log_miss):
    """A chain: track i may have detection i (log weight left[i]) or i + 1 (right[i]).

    Two-state transfer in logs: whether detection i + 1 is used after track i. Returns marginals
    (n, 3) of left, right and miss, and the log of the total weight.
    """
    n = len(left)
    none = -np.inf
    # step[i][a, b]: detection i was used (a) and i + 1 is (b); choices listed apart.
    choices = [
        {
            "left": np.array([[left[i], none], [none, none]]),
            "right": np.array([[none, right[i]], [none, right[i]]]),
            "miss": np.array([[log_miss[i], none], [log_miss[i], none]]),
        }
        for i in range(n)
    ]
    steps = [np.logaddexp.reduce(list(c.values())) for c in choices]
    forward = [np.array([0.0, none])]
    for step in steps:
        forward.append(np.logaddexp.reduce(forward[-1][:, None] + step, axis=0))
    backward = [np.zeros(2)]
    for step in reversed(steps):
        backward.append(np.logaddexp.reduce(step + backward[-1], axis=1))
    backward.reverse()
    log_total = float(np.logaddexp.reduce(forward[-1]))
    marginals = np.array([
        [
            np.exp(np.logaddexp.reduce(f[:, None] + c[kind] + b, axis=None) - log_total)
            for kind in ("left", "right", "miss")
        ]
        for f, c, b in zip(forward, choices, backward[1:], strict=False)
    ])  # fmt: skip
    return marginals, log_total
