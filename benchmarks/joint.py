"""Joint marginals: time by the size of the group, and the peer, Stone Soup, on the same input.

A full group is n tracks that may all have the same n detections; a chain, tracks that each share a
detection with the next. Stone Soup's JPDA lists the events, its JPDAwithEHM2 shares work between
them; both get the same predictions and detections, in the same process. Its time includes making
the predictions and gating, ours begins with their likelihoods.

    python benchmarks/joint.py [--markdown FILE]
"""

from __future__ import annotations

import argparse
import datetime
from functools import partial
from importlib import import_module
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np

import asterism as am
from report import best_of, conditions, publish, table

if TYPE_CHECKING:
    from numpy.typing import NDArray

P_D, CLUTTER, NOISE, SPACING = 0.9, 5.0, 0.01, 0.05


def full(n: int, seed: int = 1) -> tuple[NDArray[np.float64], NDArray[np.float64]]:
    rng = np.random.default_rng(seed)
    return rng.normal(0, 2, (n, n)), rng.normal(0, 1, n)


def chain(n: int, seed: int = 1) -> tuple[NDArray[np.float64], NDArray[np.float64]]:
    rng = np.random.default_rng(seed)
    weights = np.full((n, n + 1), -np.inf)
    i = np.arange(n)
    weights[i, i], weights[i, i + 1] = rng.normal(0, 2, (2, n))
    return weights, rng.normal(0, 1, n)


def sizes() -> list[list[str]]:
    cases = {f"{n} × {n}, all with all": full(n) for n in (6, 10, 14, 18, 20, 22)}
    cases |= {f"chain of {n}": chain(n) for n in (10, 100, 1000)}
    rows: list[list[str]] = []
    for name, group in cases.items():
        found = am.solve.joint_marginals(*group, max_states=2**22)
        taken = best_of(5, lambda g=group: am.solve.joint_marginals(*g, max_states=2**22))
        rows.append([name, found.method, "0", f"{found.n_states:,}", f"{taken * 1e3:.2f}"])
    for n in (20, 30, 60):
        for states in (2**12, 2**16):
            group = full(n)
            found = am.solve.joint_marginals(*group, max_states=states)
            taken = best_of(3, lambda g=group, s=states: am.solve.joint_marginals(*g, max_states=s))
            rows.append(
                [
                    f"{n} × {n}, {states:,} states allowed",
                    found.method,
                    f"{found.bound:.2g}",
                    f"{found.n_states:,}",
                    f"{taken * 1e3:.2f}",
                ]
            )
    return rows


def _of(module: str) -> Any:
    """Give a module of Stone Soup, which has no types and need not be there."""
    return import_module(module)


class StoneSoup:
    """A frame of tracks and detections as Stone Soup holds it."""

    def __init__(self, n: int, seed: int) -> None:
        models = "stonesoup.models"
        LinearGaussian = _of(f"{models}.measurement.linear").LinearGaussian
        transition = _of(f"{models}.transition.linear")
        GaussianState = _of("stonesoup.types.state").GaussianState
        Detection, Track = (
            _of("stonesoup.types.detection").Detection,
            _of("stonesoup.types.track").Track,
        )
        predictor_of = _of("stonesoup.predictor.kalman").KalmanPredictor
        updater_of = _of("stonesoup.updater.kalman").KalmanUpdater
        hypothesiser_of = _of("stonesoup.hypothesiser.probability").PDAHypothesiser

        rng = np.random.default_rng(seed)
        start = datetime.datetime(2020, 1, 1)
        self.now = start + datetime.timedelta(seconds=0.1)
        sensor = LinearGaussian(6, [0, 2, 4], NOISE**2 * np.eye(3))
        motion = transition.CombinedLinearGaussianTransitionModel(
            [transition.ConstantVelocity(0.01)] * 3
        )
        predictor = predictor_of(motion)
        self.hypothesiser = hypothesiser_of(
            predictor,
            updater_of(sensor),
            clutter_spatial_density=CLUTTER,
            prob_detect=P_D,
            prob_gate=1 - 1e-12,
        )
        x = rng.normal(0, SPACING, (n, 3))
        y = x + rng.normal(0, 1.5 * NOISE, (n, 3))
        self.tracks: list[Any] = []
        for point in x:
            mean = np.zeros((6, 1))
            mean[::2, 0] = point
            covariance = np.diag([NOISE**2, 0.01] * 3)
            self.tracks.append(Track([GaussianState(mean, covariance, timestamp=start)]))
        self.detections: list[Any] = [
            Detection(point[:, None], measurement_model=sensor, timestamp=self.now) for point in y
        ]
        # The same predictions, for ours.
        H: Any = sensor.matrix()
        self.weights = np.full((n, n), -np.inf)
        for i, track in enumerate(self.tracks):
            p: Any = predictor.predict(track[-1], timestamp=self.now)
            S = H @ p.covar @ H.T + NOISE**2 * np.eye(3)
            apart = y - (H @ p.mean).ravel()
            chi2 = np.einsum("ja,ab,jb->j", apart, np.linalg.inv(S), apart)
            log_norm = np.linalg.slogdet(2 * np.pi * S)[1]
            inside = chi2 <= 55  # its gate at this probability
            self.weights[i, inside] = np.log(P_D / CLUTTER) - 0.5 * (chi2 + log_norm)[inside]
        self.miss = np.full(n, np.log(1 - P_D))

    def marginals(self, associator: Any) -> NDArray[np.float64]:
        """Give the marginals that an associator finds, the miss last."""
        found: Any = associator(self.hypothesiser).associate(
            self.tracks, set(self.detections), self.now
        )
        n = len(self.tracks)
        beta = np.zeros((n, n + 1))
        for i, track in enumerate(self.tracks):
            for hypothesis in found[track]:
                j = self.detections.index(hypothesis.measurement) if hypothesis else n
                beta[i, j] = float(hypothesis.probability)
        return beta


def beside_stone_soup() -> list[list[str]]:
    try:
        associators = _of("stonesoup.dataassociator.probability")
    except ImportError:
        return []
    rows: list[list[str]] = []
    for n, seeds in ((3, 20), (5, 20), (7, 5), (10, 5)):
        for name in ("JPDA", "JPDAwithEHM2"):
            if name == "JPDA" and n > 5:
                continue  # which lists every event: minutes
            associator = getattr(associators, name)
            worst, theirs, ours = 0.0, 0.0, 0.0
            for seed in range(seeds):
                frame = StoneSoup(n, seed)
                beta = frame.marginals(associator)
                found = am.solve.joint_marginals(frame.weights, frame.miss)
                worst = max(worst, float(abs(beta - found.marginals).max()))
                theirs += best_of(1, partial(frame.marginals, associator))
                ours += best_of(3, partial(am.solve.joint_marginals, frame.weights, frame.miss))
            assert worst < 1e-9, "two ways of summing the same events"
            rows.append(
                [
                    f"{n} × {n}",
                    name,
                    f"{worst:.1e}",
                    f"{theirs / seeds * 1e3:.2f}",
                    f"{ours / seeds * 1e3:.3f}",
                    f"{theirs / ours:,.0f} ×",
                ]
            )
    return rows


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--markdown", type=Path)
    options = parser.parse_args()
    lines = table(["group", "summed", "bound", "states", "ms"], sizes())
    peer = beside_stone_soup()
    if peer:
        head = ["frame", "Stone Soup", "greatest difference", "its ms", "ours, ms", "against it"]
        lines += ["", *table(head, peer)]
    publish([*lines, "", f"{conditions()}; one core."], options.markdown)


if __name__ == "__main__":
    main()
