"""§5.2 to 5.4: deferred acceptance is stable, best for who proposes, and short."""

from __future__ import annotations

import itertools
from typing import TYPE_CHECKING

import numpy as np

from asterism import _engine
from asterism.plot.style import CYCLE, INK, new_panels, tidy
from asterism.reproduction.part import Claim, Outcome, Part, Picture, Table
from asterism.reproduction.rules import differs, exact, spread

if TYPE_CHECKING:
    from matplotlib.axes import Axes
    from matplotlib.figure import Figure
    from numpy.typing import NDArray

    from asterism.reproduction.part import Effort, Tell

    Ranks = NDArray[np.int64]

SMALL = (2, 3, 4, 5, 6)
LARGE = (4, 8, 16, 32, 64, 128, 256, 512)
# Figure 5.1 in kind: three of each; the men's lists, the women's lists, best first.
MEN, WOMEN = ((0, 1, 2), (1, 0, 2), (0, 2, 1)), ((0, 2, 1), (1, 0, 2), (2, 0, 1))
UNSTABLE = (1, 0, 2)


def marry(men: Ranks, women: Ranks) -> tuple[NDArray[np.int32], int]:
    """Marry by the engine.

    Parameters
    ----------
    men : ndarray of int, shape (n, n)
        Row i are the women in the order in which man i likes them.
    women : ndarray of int, shape (n, n)
        Row j are the men likewise.

    Returns
    -------
    wives : ndarray of int, shape (n,)
    proposals : int
    """
    n = len(men)
    rank = np.argsort(women, axis=1)  # of man i with woman j, at [j, i]
    costs = rank[men, np.arange(n)[:, None]].astype(np.float64)
    first = np.arange(n + 1, dtype=np.int64) * n
    return _engine.marry(first, men.astype(np.int32).ravel(), costs.ravel(), n)


def dissatisfied(wives: NDArray[np.int32], men: Ranks, women: Ranks) -> list[tuple[int, int]]:
    """List the pairs that would both rather have each other."""
    his, hers = np.argsort(men, axis=1), np.argsort(women, axis=1)
    husbands = np.argsort(wives)
    n = range(len(men))
    return [
        (i, j)
        for i, j in itertools.product(n, n)
        if his[i, j] < his[i, wives[i]] and hers[j, i] < hers[j, husbands[j]]
    ]


def worst(n: int) -> tuple[Ranks, Ranks]:
    """Give the lists that take n² - n + 1 proposals."""
    men = np.array([[*((i + k) % (n - 1) for k in range(n - 1)), n - 1] for i in range(n)])
    # Whoever proposes drives out who is there: each woman likes best who comes to her last.
    women = np.array([[(j + 1 + k) % n for k in range(n)] for j in range(n)])
    return men, women


def run(effort: Effort, tell: Tell) -> Outcome:
    """Try small problems against enumeration, and count the proposals of large ones."""
    draws = 20 * effort.seeds
    unstable = below_best = cases = 0
    rng = np.random.default_rng(0)
    for n in SMALL:
        for _ in range(draws):
            men, women = _lists(rng, n), _lists(rng, n)
            wives, _ = marry(men, women)
            unstable += len(dissatisfied(wives, men, women))
            below_best += _below_best(wives, men, women)
            cases += 1
        tell(0.4 * SMALL.index(n) / len(SMALL))
    counts: dict[int, NDArray[np.float64]] = {}
    sizes = LARGE[:5] if effort.is_quick else LARGE
    for n in sizes:
        counts[n] = np.array(
            [marry(_lists(rng, n), _lists(rng, n))[1] for _ in range(effort.seeds)], dtype=float
        )
        tell(0.4 + 0.6 * (sizes.index(n) + 1) / len(sizes))
    worst_of = {n: marry(*worst(n))[1] for n in sizes}
    rows = [
        [str(n), spread(c, 0), f"{n * _harmonic(n):.0f}", str(worst_of[n]), str(n * n)]
        for n, c in counts.items()
    ]
    beyond = sum(count > n * n for n, count in worst_of.items())
    ratios = np.concatenate([c / (n * _harmonic(n)) for n, c in counts.items()])
    bound = "proposals, in units of n (1 + 1/2 + … + 1/n), than 1"
    claims = [
        Claim("no dissatisfied pair is left", "none", str(unstable),
              exact(unstable, 0, "number of them", cases)),
        Claim("every man has his highest ranked feasible partner", "always",
              f"{below_best} men have not", exact(below_best, 0, "number who have not", cases)),
        Claim("proposals in the worst case", "O(n²)", f"{max(worst_of.values()):,} at n = "
              f"{sizes[-1]}", exact(beyond, 0, "number beyond n²", len(sizes))),
        Claim("proposals on average", "O(n lg n)", f"{counts[sizes[-1]].mean():,.0f} at n = "
              f"{sizes[-1]}", differs(ratios, np.ones(len(ratios)), bound, 3)),
    ]  # fmt: skip
    head = ["n", "proposals, random lists", "n (1 + 1/2 + … + 1/n)", "the worst lists", "n²"]
    return Outcome(
        claims=claims,
        tables=[Table("Proposals until everybody is married", head, rows)],
        pictures=[Picture("report_marriage", CAPTION, _draw(counts, worst_of))],
    )


def _lists(rng: np.random.Generator, n: int) -> Ranks:
    return np.array([rng.permutation(n) for _ in range(n)])


def _harmonic(n: int) -> float:
    return float((1 / np.arange(1, n + 1)).sum())


def _below_best(wives: NDArray[np.int32], men: Ranks, women: Ranks) -> int:
    """Count the men for whom some stable marriage of all is better than theirs."""
    his = np.argsort(men, axis=1)
    n = len(men)
    best = np.full(n, n)
    for other in itertools.permutations(range(n)):
        found = np.array(other, dtype=np.int32)
        ranks = his[np.arange(n), found]
        if (ranks < best).any() and not dissatisfied(found, men, women):
            best = np.minimum(best, ranks)
    return int((his[np.arange(n), wives] > best).sum())


def _draw(counts: dict[int, NDArray[np.float64]], worst_of: dict[int, int]) -> Figure:
    panels = new_panels(1, 3, width=11.0, height=3.4)
    men, women = np.array(MEN), np.array(WOMEN)
    _couples(panels[0], marry(men, women)[0], men, women, "a stable marriage")
    _couples(panels[1], np.array(UNSTABLE, dtype=np.int32), men, women, "another")
    axes = panels[2]
    n = np.array(list(counts))
    axes.plot(n, [c.mean() for c in counts.values()], "o-", color=CYCLE[0], label="random lists")
    axes.plot(n, [k * _harmonic(k) for k in counts], "--", color=CYCLE[1],
              label="n (1 + 1/2 + … + 1/n)")  # fmt: skip
    axes.plot(n, list(worst_of.values()), "s", color=CYCLE[2], label="the worst lists")
    axes.plot(n, n**2, ":", color=CYCLE[3], label="n²")
    axes.set_xscale("log")
    axes.set_yscale("log")
    axes.minorticks_off()
    axes.set_xlabel("n", color=INK)
    axes.set_title("proposals", fontsize=10, color=INK, loc="left")
    axes.legend(frameon=False, fontsize=8, labelcolor=INK)
    tidy(axes)
    return axes.figure  # pyright: ignore[reportReturnType]


def _couples(axes: Axes, wives: NDArray[np.int32], men: Ranks, women: Ranks, title: str) -> None:
    """Draw men left, women right, their lists, who is married, and who would rather be."""
    n = len(men)
    for i in range(n):
        liked = " ".join("abc"[j] for j in men[i])
        likes = " ".join("ABC"[k] for k in women[i])
        axes.text(-0.08, -i, f"{liked}   {'ABC'[i]}", ha="right", va="center", color=INK)
        axes.text(1.08, -i, f"{'abc'[i]}   {likes}", ha="left", va="center", color=INK)
        axes.plot([0, 1], [-i, -int(wives[i])], color=CYCLE[0], linewidth=2)
    blocking = dissatisfied(wives, men, women)
    for i, j in blocking:
        axes.plot([0, 1], [-i, -j], color=CYCLE[5], linewidth=1.2, linestyle="--")
    told = ", ".join(f"{'ABC'[i]}-{'abc'[j]}" for i, j in blocking)
    told = f"{title}: {told} dissatisfied" if blocking else f"{title}: nobody dissatisfied"
    axes.set_title(told, fontsize=10, color=INK, loc="left")
    axes.set(xlim=(-0.8, 1.8), ylim=(-n + 0.5, 0.5))
    axes.set_axis_off()


CAPTION = (
    "The report's figure 5.1: two ways to marry the same men (left, with their lists, best first) "
    "and women; dashed, who would both rather have each other. Right: proposals, means over the "
    "seeds."
)

PART = Part(
    title="The stable marriage: the algorithm",
    section="§5.1 to §5.4",
    covers="figure 5.1, algorithm 3",
    did="Proves that the proposal algorithm ends with a stable marriage that is best for those who "
    "propose, after O(n²) proposals at worst and O(n lg n) on average.",
    run=run,
    slips=(
        "A woman who has been proposed to stays married, so “every woman receives at least one "
        "proposal” follows from equal numbers alone; with unequal ones somebody stays alone.",
    ),
)
