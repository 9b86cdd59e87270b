"""§2.1: two targets with a common measurement, and the marginals over all joint events."""

from __future__ import annotations

import itertools
from typing import TYPE_CHECKING, Any

import numpy as np

from asterism.plot.style import CYCLE, INK, new_axes
from asterism.reproduction.part import Outcome, Part, Table
from asterism.reproduction.rules import exact
from asterism.solve import joint_marginals

if TYPE_CHECKING:
    from matplotlib.axes import Axes
    from numpy.typing import NDArray

P_DETECTION, CLUTTER = 0.9, 0.05  # the latter per unit of area
GATE = 9.21  # χ² of two degrees of freedom at 1 %
# A case like figure 2.1: predictions, standard deviations along the axes, and measurements.
TARGETS = np.array([[0.0, 0.0], [2.2, 0.3]])
SIGMA = np.array([[0.8, 0.45], [0.75, 0.5]])
MEASUREMENTS = np.array([[-0.9, 0.35], [1.15, 0.2], [3.1, 0.9]])
LARGEST = 5
TOLERANCE = 1e-12


def run(seeds: int) -> Outcome:
    """Compare sums over joint events by enumeration and by elimination, for figure 2.1 too."""
    error = doubled = 0.0
    cases = list(itertools.product(range(seeds), range(1, LARGEST), range(1, LARGEST + 1)))
    for seed, same in itertools.groupby(cases, lambda case: case[0]):
        rng = np.random.default_rng(seed)
        for _, n, m in same:
            log_w = rng.normal(0, 2, (n, m))
            log_w[rng.random((n, m)) < 0.3] = -np.inf
            log_miss = rng.normal(-2, 1, n)
            found = joint_marginals(log_w, log_miss).marginals
            error = max(error, float(np.abs(found - _enumerated(log_w, log_miss)).max()))
            doubled = max(doubled, float(found[:, :-1].sum(axis=0).max()) - 1)
    log_w = _log_weights()
    log_miss = np.full(len(TARGETS), np.log(1 - P_DETECTION))
    joint = joint_marginals(log_w, log_miss).marginals
    alone = np.vstack([joint_marginals(w[None], log_miss[:1]).marginals for w in log_w])
    rows = [
        [f"target {'AB'[t]}, {name}", *(f"{p:.3f}" for p in marginals[t])]
        for t in range(len(TARGETS))
        for name, marginals in (("each target alone (PDA)", alone), ("jointly (JPDA)", joint))
    ]
    common = alone[:, 1].sum()
    claims = [
        exact("marginals are sums over all joint events", "an identity", error,
              "greatest difference from enumeration", len(cases), TOLERANCE),
        exact("no measurement belongs to more than one target", "an identity", max(0.0, doubled),
              "greatest excess over one target", len(cases), TOLERANCE),
        exact(f"separate PDA assigns a common measurement more than once (sum {common:.3f})",
              "figure 2.1", float(common <= 1), "number of cases in which it does not", 1),
    ]  # fmt: skip
    head = ["figure 2.1", "y₁", "y₂, common", "y₃", "none"]
    return Outcome(
        claims=claims,
        tables=[Table("Probability that a measurement is a target's", head, rows)],
        figure=_draw(joint),
    )


def _log_weights() -> NDArray[np.float64]:
    """Log of N(y; ŷ, S) P_d / λ_f within the gate, shape (targets, measurements)."""
    scaled = (MEASUREMENTS[None] - TARGETS[:, None]) / SIGMA[:, None]
    distance = (scaled**2).sum(axis=2)
    density = -0.5 * distance - np.log(2 * np.pi * SIGMA.prod(axis=1))[:, None]
    return np.where(distance <= GATE, density + np.log(P_DETECTION / CLUTTER), -np.inf)


def _enumerated(log_w: NDArray[np.float64], log_miss: NDArray[np.float64]) -> NDArray[np.float64]:
    """Return the marginals by listing every joint event."""
    n, m = log_w.shape
    total = np.zeros((n, m + 1))
    weights = np.exp(np.column_stack([log_w, log_miss]))
    for event in itertools.product(range(m + 1), repeat=n):
        taken = [j for j in event if j < m]
        if len(set(taken)) == len(taken):
            total[np.arange(n), event] += weights[np.arange(n), event].prod()
    return total / total.sum(axis=1, keepdims=True)


def _draw(joint: NDArray[np.float64]) -> Axes:
    from matplotlib.patches import Ellipse

    axes: Any = new_axes(height=3.6)
    for t, (place, sigma) in enumerate(zip(TARGETS, SIGMA, strict=True)):
        width, height = 2 * np.sqrt(GATE) * sigma
        colour = CYCLE[t]
        axes.add_patch(Ellipse(place, width, height, alpha=0.12, facecolor=colour))
        axes.add_patch(Ellipse(place, width, height, fill=False, edgecolor=colour))
        axes.plot(*place, marker="+", markersize=11, color=colour, linestyle="none")
        axes.annotate(f"ŷ {'AB'[t]}", place, xytext=(6, -14), textcoords="offset points",
                      color=colour)  # fmt: skip
    for j, y in enumerate(MEASUREMENTS):
        axes.plot(*y, marker="o", color=INK, linestyle="none")
        shares = "\n".join(f"{'AB'[t]}: {p:.2f}" for t, p in enumerate(joint[:, j]) if p > 0)
        axes.annotate(f"y{'₁₂₃'[j]}  {shares}", y, xytext=(7, 5), textcoords="offset points",
                      fontsize=9, color=INK)  # fmt: skip
    axes.set_aspect("equal")
    axes.autoscale_view()
    axes.set_axis_off()
    return axes


PART = Part(
    name="gates",
    title="JPDA: two targets with a common measurement",
    section="§2.1",
    covers="figure 2.1",
    summary="States the joint association events and that a marginal is the sum over all joint "
    "events in which it occurs; a measurement in two validation regions disturbs a filter that "
    "treats each target separately.",
    run=run,
    caption="The report's figure 2.1: two targets with their validation regions (1 %) and a common "
    "measurement y₂; beside each measurement the joint probability that it is A's or B's.",
    assumptions=(
        "The places of figure 2.1, which has no scale; P_d = 0.9, clutter 0.05 per unit of area.",
    ),
)
