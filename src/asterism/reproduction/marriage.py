"""§5.2 to 5.4: deferred acceptance is stable, optimal for the proposing side, and short."""

from __future__ import annotations

import itertools
from typing import TYPE_CHECKING

import numpy as np

from asterism import _engine
from asterism.plot.style import CYCLE, INK
from asterism.reproduction.drawing import titled, titled_panels
from asterism.reproduction.part import Outcome, Part, Table
from asterism.reproduction.rules import exact, fewer, spread

if TYPE_CHECKING:
    from matplotlib.axes import Axes
    from numpy.typing import NDArray

    Ranks = NDArray[np.int64]

SMALL = (2, 3, 4, 5, 6)
LARGE = (4, 8, 16, 32, 64, 128, 256, 512)
DRAWS = 20  # a seed, of small problems of each size
# A case like figure 5.1 with three of each: the men's lists, the women's lists, best first.
MEN = np.array([(0, 1, 2), (1, 0, 2), (0, 2, 1)])
WOMEN = np.array([(0, 2, 1), (1, 0, 2), (2, 0, 1)])
UNSTABLE = np.array([1, 0, 2], dtype=np.int32)


def marry(men: Ranks, women: Ranks) -> tuple[NDArray[np.int32], int]:
    """Find a stable matching with the engine.

    Parameters
    ----------
    men : ndarray of int, shape (n, n)
        Row i holds the women in the order of man i's preference.
    women : ndarray of int, shape (n, n)
        Row j holds the men in the order of woman j's preference.

    Returns
    -------
    wives : ndarray of int, shape (n,)
        Partner of each man.
    proposals : int
        Number of proposals.
    """
    n = len(men)
    rank = np.argsort(women, axis=1)  # of man i with woman j, at [j, i]
    costs = rank[men, np.arange(n)[:, None]].astype(np.float64)
    first = np.arange(n + 1, dtype=np.int64) * n
    return _engine.marry(first, men.astype(np.int32).ravel(), costs.ravel(), n)


def blocking_pairs(wives: NDArray[np.int32], men: Ranks, women: Ranks) -> list[tuple[int, int]]:
    """List the pairs that both prefer each other to their partners."""
    men_ranks, women_ranks = np.argsort(men, axis=1), np.argsort(women, axis=1)
    n = np.arange(len(men))
    his = men_ranks < men_ranks[n, wives][:, None]
    hers = women_ranks < women_ranks[n, np.argsort(wives)][:, None]
    return [(int(i), int(j)) for i, j in np.argwhere(his & hers.T)]


def worst(n: int) -> tuple[Ranks, Ranks]:
    """Return the lists that take n² - n + 1 proposals."""
    men = np.array([[*((i + k) % (n - 1) for k in range(n - 1)), n - 1] for i in range(n)])
    # Each woman prefers the man who proposes to her last, so each proposal replaces a partner.
    women = np.array([[(j + 1 + k) % n for k in range(n)] for j in range(n)])
    return men, women


def run(seeds: int) -> Outcome:
    """Compare small problems with enumeration, and count the proposals of large ones."""
    rng = np.random.default_rng(0)
    small = [(_lists(rng, n), _lists(rng, n)) for n in SMALL for _ in range(DRAWS * seeds)]
    unstable = not_best = 0
    for men, women in small:
        wives, _ = marry(men, women)
        unstable += len(blocking_pairs(wives, men, women))
        not_best += _n_not_best(wives, men, women)
    counts = np.array(
        [[marry(_lists(rng, n), _lists(rng, n))[1] for _ in range(seeds)] for n in LARGE]
    )
    slowest = np.array([marry(*worst(n))[1] for n in LARGE])
    expected = np.array([n * (1 / np.arange(1, n + 1)).sum() for n in LARGE])
    ratios = (counts / expected[:, None]).ravel()
    claims = [
        exact("the marriages are stable", "none", unstable, "number of dissatisfied pairs",
              len(small)),
        exact("every man has his highest ranked feasible partner", "always", not_best,
              "number of men without this partner", len(small)),
        exact("proposals in the worst case", "O(n²)",
              int((slowest > np.square(LARGE)).sum()), "number beyond n²", len(LARGE)),
        fewer("proposals on average", "O(n lg n)", ratios, np.ones(len(ratios)),
              "of n (1 + 1/2 + … + 1/n)", 3),
    ]  # fmt: skip
    head = ["n", "proposals, random lists", "n (1 + 1/2 + … + 1/n)", "the worst lists", "n²"]
    rows = [
        [str(n), spread(c, 0), f"{e:.0f}", str(w), str(n * n)]
        for n, c, e, w in zip(LARGE, counts, expected, slowest, strict=True)
    ]
    table = Table("Proposals until the matching is complete", head, rows)
    return Outcome(claims=claims, tables=[table], figure=_draw())


def _lists(rng: np.random.Generator, n: int) -> Ranks:
    return np.array([rng.permutation(n) for _ in range(n)])


def _n_not_best(wives: NDArray[np.int32], men: Ranks, women: Ranks) -> int:
    """Count the men whom another of all stable matchings gives a better partner."""
    ranks, n = np.argsort(men, axis=1), np.arange(len(men))
    best = ranks[n, wives]
    for other in itertools.permutations(range(len(men))):
        found = np.array(other, dtype=np.int32)
        if (ranks[n, found] < best).any() and not blocking_pairs(found, men, women):
            best = np.minimum(best, ranks[n, found])
    return int((ranks[n, wives] > best).sum())


def _draw() -> list[Axes]:
    matchings = {"a stable matching": marry(MEN, WOMEN)[0], "an unstable one": UNSTABLE}
    panels = titled_panels(*matchings, width=8.0, height=3.4)
    for axes, (title, wives) in zip(panels, matchings.items(), strict=True):
        for i in range(len(MEN)):
            his, hers = " ".join("abc"[j] for j in MEN[i]), " ".join("ABC"[k] for k in WOMEN[i])
            axes.text(-0.08, -i, f"{his}   {'ABC'[i]}", ha="right", va="center", color=INK)
            axes.text(1.08, -i, f"{'abc'[i]}   {hers}", ha="left", va="center", color=INK)
            axes.plot([0, 1], [-i, -int(wives[i])], color=CYCLE[0], linewidth=2)
        blocking = blocking_pairs(wives, MEN, WOMEN)
        for i, j in blocking:
            axes.plot([0, 1], [-i, -j], color=CYCLE[5], linewidth=1.2, linestyle="--")
        pairs = ", ".join(f"{'ABC'[i]}-{'abc'[j]}" for i, j in blocking) or "no pair"
        titled(axes, f"{title}: {pairs} dissatisfied")
        axes.set(xlim=(-0.8, 1.8), ylim=(-len(MEN) + 0.5, 0.5))
        axes.set_axis_off()
    return panels


PART = Part(
    name="marriage",
    title="The stable marriage: the algorithm",
    section="§5.1 to §5.4",
    covers="figure 5.1, algorithm 3",
    summary="Proves that the proposal algorithm ends with a stable marriage that is optimal for "
    "the proposing side, after O(n²) proposals at worst and O(n lg n) on average.",
    run=run,
    caption="The report's figure 5.1: two matchings of the same men (left, with their lists, best "
    "first) and women; dashed, the pairs that prefer each other to their partners.",
    mistakes=(
        "A woman who has been proposed to stays married, so “every woman receives at least one "
        "proposal” follows from equal numbers alone; with unequal ones some have no partner.",
    ),
)
