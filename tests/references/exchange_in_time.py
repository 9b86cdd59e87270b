"""Exchange of two tracks in intervals: every choice of intervals, each by plain loops."""

from __future__ import annotations

import itertools

import numpy as np

BEGIN, FARTHEST, MIN_RATIO = -6.0, 12.0, -4.0
EXCHANGE = (-1.54, 0.21, 0.76)


def best_intervals(lanes, is_short, log_likelihood, ratio_of):
    """Return the gain of the best exchange that respects what is stated, None without one.

    Each lane is a list of (detection, frame, gain, is_start, probability, stated).
    """
    cuts = set()
    for lane in lanes:
        for i, (_, t, _, is_start, _, _) in enumerate(lane):
            if is_start:
                cuts.add(t)
            if i + 1 == len(lane) or lane[i + 1][3]:
                cuts.add(t + 1)
    cuts = sorted(cuts)
    costs = {cut: cost(lanes, cut, is_short, log_likelihood, ratio_of) for cut in cuts}
    best = None
    for states in itertools.product((False, True), repeat=len(cuts) - 1):
        intervals = [(s, e) for s, e, state in zip(cuts, cuts[1:], states, strict=False) if state]
        if respects(lanes, intervals):
            gain = gain_of(lanes, intervals, costs.__getitem__)
            best = gain if best is None else max(best, gain)
    return best


def respects(lanes, intervals):
    """Return whether all that must go is in an interval, and nothing that must stay."""
    return all(
        any(s <= t < e for s, e in intervals) == (stated > 0)
        for lane in lanes
        for (_, t, _, _, _, stated) in lane
        if stated
    )


def gain_of(lanes, intervals, cost_of):
    """Return the log odds that an exchange in intervals gains."""
    gain = sum(
        g for lane in lanes for (_, t, g, _, _, _) in lane if any(s <= t < e for s, e in intervals)
    )
    edges = [edge for interval in intervals for edge in interval]
    return gain - sum(cost_of(edge) for edge in edges if edges.count(edge) == 1)


def cost(lanes, cut, is_short, log_likelihood, ratio_of):
    """Return the log odds that are lost where both tails are exchanged."""
    heads = [[one for one in lane if one[1] < cut] for lane in lanes]
    tails = [[one for one in lane if one[1] >= cut] for lane in lanes]

    def link(i, j):
        """Return the two detections before a link from lane i to lane j, and the one after."""
        before = heads[i][-2][0] if len(heads[i]) > 1 else -1
        head = heads[i][-1][0] if heads[i] else -1
        return before, head, tails[j][0][0] if tails[j] else -1

    ratio, links, has_short = 0.0, 0.0, False
    for j in (0, 1):
        if not tails[j]:
            continue
        kept, other = link(j, j), link(1 - j, j)
        ratio += log_likelihood(*other) - log_likelihood(*kept)
        has_short |= is_short(*kept[1:]) or is_short(*other[1:])
        if heads[j] and not is_short(*kept[1:]):
            p = min(tails[j][0][4], 0.98)
            links += np.log(p / (1 - p))
    if not has_short:
        return links
    if ratio > 2 * MIN_RATIO and all(is_short(*link(i, j)[1:]) for i in (0, 1) for j in (0, 1)):
        ratio = ratio_of(cut)
    is_mutual = all(heads) and all(tails)
    found = EXCHANGE[0] + EXCHANGE[1] * min(max(ratio, MIN_RATIO), 10.0)
    return links - (found + EXCHANGE[2] * is_mutual + min(ratio - MIN_RATIO, 0.0))
