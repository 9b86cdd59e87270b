"""Markets of proposers and receivers, and their stable marriage by the engine."""

from __future__ import annotations

import numpy as np

from asterism import _engine


def marry(lists: list[list[int]], costs: dict[tuple[int, int], float], n_receivers: int):
    first = np.concatenate([[0], np.cumsum([len(wishes) for wishes in lists])]).astype(np.int64)
    receivers = np.array([r for wishes in lists for r in wishes], dtype=np.int32)
    cost = np.array([costs[p, r] for p, wishes in enumerate(lists) for r in wishes], dtype=float)
    return _engine.marry(first, receivers, cost, n_receivers)


def random_market(rng: np.random.Generator, n: int, m: int, share: float, *, ties: bool = False):
    lists = [[int(r) for r in rng.permutation(m) if rng.random() < share] for _ in range(n)]
    scale = 3 if ties else 1_000_000
    costs = {(p, r): float(rng.integers(scale)) for p in range(n) for r in range(m)}
    return lists, costs
