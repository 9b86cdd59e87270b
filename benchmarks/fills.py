"""Filled gaps against the truth: stretches of real captures occluded on purpose.

Stretches of 10, 30, 60 and 120 frames of markers that are seen around them are taken out, up to
three at a time, at random places (seeded), and filled by `am.fill_gaps`, by a cubic spline
through ten frames on each side, and by Kinetics Toolkit's `fill_missing_samples` (linear, its
default, and cubic). The gaps that the captures have themselves stay. Then 10 % of the points of
an excerpt are occluded at random, wherever they are. A marker is *bonded* if the distance to
three others or more varies by less than 10 mm (half of the middle 68 %).

    python benchmarks/fills.py [--data FOLDER] [--only NAME] [--rounds N] [--markdown FILE]
"""

from __future__ import annotations

import argparse
import time
import warnings
from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING

import numpy as np
from scipy.interpolate import CubicSpline

import asterism as am
from asterism.tracking.rigidity.distances import distances_from
from captures import captures, named_only
from report import conditions, publish, table

if TYPE_CHECKING:
    from numpy.typing import NDArray

LENGTHS = (10, 30, 60, 120)
ENDS = 10
AT_A_TIME = 3
MOST = 40  # stretches a round
SCATTERED, EXCERPT = 0.1, 300  # share of the points, frames
BONDED = 0.010
WAYS = ("fill", "spline", "ktk linear", "ktk cubic")


@dataclass(frozen=True)
class Stretch:
    """One stretch that was occluded: how far each way is off, and how far `fill` said it may be."""

    capture: str
    length: int
    is_bonded: bool
    is_tried: bool
    off: dict[str, NDArray[np.float64]]
    stds: NDArray[np.float64]

    def rms(self, way: str) -> float:
        """Root of the mean square distance, mm."""
        return 1e3 * float(np.sqrt((self.off[way] ** 2).sum(axis=1).mean()))


def chosen(
    seen: NDArray[np.bool_], length: int, rng: np.random.Generator
) -> list[tuple[int, int, int]]:
    """Draw stretches (marker, first, stop) of markers seen throughout and around them."""
    T, K = seen.shape
    n_occluded = np.zeros(T, dtype=int)
    found: list[tuple[int, int, int]] = []
    for _ in range(40 * MOST):
        if len(found) == MOST or length + 2 * ENDS > T:
            break
        k, first = int(rng.integers(K)), int(rng.integers(ENDS, T - length - ENDS + 1))
        around = slice(first - ENDS, first + length + ENDS)
        is_free = n_occluded[around].max() < AT_A_TIME and k not in {other for other, *_ in found}
        if is_free and seen[around, k].all():
            found.append((k, first, first + length))
            n_occluded[around] += 1
    return found


def by_kinetics_toolkit(
    times: NDArray[np.float64], positions: NDArray[np.float64], method: str
) -> NDArray[np.float64]:
    with warnings.catch_warnings():
        warnings.simplefilter("ignore")  # on import, of what else could be installed
        import kineticstoolkit as ktk  # pyright: ignore[reportMissingImports]  # of the benchmarks

        names = [str(k) for k in range(positions.shape[1])]
        series = ktk.TimeSeries(  # pyright: ignore
            time=times, data={name: positions[:, k] for k, name in enumerate(names)}
        )
        filled = series.fill_missing_samples(0, method=method)
    return np.stack([filled.data[name] for name in names], axis=1)


def measure(name: str, truth: am.Tracks, length: int, seed: int) -> tuple[list[Stretch], float]:
    """Hide stretches of one length, fill them, and compare; also the milliseconds a gap took."""
    d = truth.detections
    whole = truth.positions()
    rng = np.random.default_rng([seed, length])
    occluded = whole.copy()
    stretches = chosen(np.isfinite(whole[..., 0]), length, rng)
    if not stretches:
        return [], np.nan
    for k, first, stop in stretches:
        occluded[first:stop, k] = np.nan
    tracks = am.Tracks.from_dense(d.times, occluded, truth.names)
    model = am.estimate_model(tracks.detections).model
    longest = float(max(d.times[stop] - d.times[first - 1] for _, first, stop in stretches)) + 1e-6
    start = time.process_time()
    filling = am.fill_gaps(tracks, model=model, longest=longest)
    ms = 1e3 * (time.process_time() - start) / filling.n_filled
    gaps = {(gap.track, gap.first): gap for gap in filling.gaps}
    of_fill = filling.tracks.positions()
    e = filling.tracks.detections
    stds = np.zeros(whole.shape[:2])
    inside = filling.tracks.labels >= 0
    assert e.stds is not None
    stds[e.frame_of[inside], filling.tracks.labels[inside]] = e.stds[inside]
    every = {"fill": of_fill}
    columns = sorted({k for k, *_ in stretches})
    regular = np.arange(d.n_frames) / (1 / d.step)  # it refuses times that differ in a last bit
    for way in ("linear", "cubic"):
        every[f"ktk {way}"] = np.full_like(whole, np.nan)
        every[f"ktk {way}"][:, columns] = by_kinetics_toolkit(regular, occluded[:, columns], way)
    found: list[Stretch] = []
    for k, first, stop in stretches:
        at, true = slice(first, stop), whole[first:stop, k]
        ends = np.r_[first - ENDS : first, stop : stop + ENDS]
        spline = CubicSpline(d.times[ends], occluded[ends, k])(d.times[at])
        spreads = distances_from(whole[:, k], np.delete(whole, k, axis=1)).spread
        found.append(
            Stretch(
                capture=name,
                length=length,
                is_bonded=int((spreads < BONDED).sum()) >= 3,
                is_tried=gaps[k, first].n_windows > 0,
                off={way: values[at, k] - true for way, values in every.items()}
                | {"spline": spline - true},
                stds=stds[at, k],
            )
        )
    return found, ms


def scattered(truth: am.Tracks) -> list[str]:
    """Hide points at random and fill: how many could be tried, how far off beside the spline."""
    d = truth.detections
    whole = truth.positions()[:EXCERPT]
    is_occluded = np.random.default_rng(0).random(whole.shape[:2]) < SCATTERED
    occluded = np.where(is_occluded[..., None], np.nan, whole)
    tracks = am.Tracks.from_dense(d.times[:EXCERPT], occluded, truth.names)
    filling = am.fill_gaps(tracks)
    e = filling.tracks.detections
    assert e.stds is not None
    frames, labels = e.frame_of[e.filled], filling.tracks.labels[e.filled]
    kept = is_occluded[frames, labels] & np.isfinite(whole[frames, labels, 0])
    frames, labels = frames[kept], labels[kept]
    true = whole[frames, labels]
    off = e.points[e.filled][kept] - true
    z = off / e.stds[e.filled][kept, None]
    spline = np.empty_like(off)
    for k in np.unique(labels):
        seen, mine = np.flatnonzero(np.isfinite(occluded[:, k, 0])), labels == k
        spline[mine] = CubicSpline(d.times[seen], occluded[seen, k])(d.times[frames[mine]])
    of_fill, of_spline = (1e3 * np.linalg.norm(one, axis=1) for one in (off, spline - true))
    tried = [gap.n_windows > 0 for gap in filling.gaps if gap.is_filled]
    return [
        str(len(tried)), f"{100 * np.mean(tried):.1f}",
        *(f"{np.sqrt((mm**2).mean()):.2f} ({np.median(mm):.2f})" for mm in (of_fill, of_spline)),
        f"{100 * (np.abs(z) < 1.96).mean():.1f}", f"{(z**2).mean():.2f}",
        f"{1e3 * e.stds[e.filled][kept].max():.1f}",
    ]  # fmt: skip


def accuracy(found: list[Stretch]) -> list[str]:
    """RMS and median of each way, mm, and by what `fill` divides the spline's."""
    cells = [str(len(found))]
    rms = {way: np.array([s.rms(way) for s in found]) for way in WAYS}
    cells += [f"{np.sqrt((rms[w] ** 2).mean()):.2f} ({np.median(rms[w]):.2f})" for w in WAYS]
    whole = np.sqrt((rms["spline"] ** 2).mean() / (rms["fill"] ** 2).mean())
    return [*cells, f"{whole:.1f} ({np.median(rms['spline']) / np.median(rms['fill']):.1f})"]


def calibration(found: list[Stretch]) -> list[str]:
    """Coverage and mean square of errors by their standard deviation."""
    z = np.concatenate([(s.off["fill"] / s.stds[:, None]).ravel() for s in found])
    return [
        str(len(found)),
        f"{100 * (np.abs(z) < 1).mean():.1f}",
        f"{100 * (np.abs(z) < 1.96).mean():.1f}",
        f"{(z**2).mean():.2f}",
    ]


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__)
    beside = Path(__file__).resolve().parents[2] / "shared" / "data"
    parser.add_argument("--data", type=Path, default=beside)
    parser.add_argument("--only", default="")
    parser.add_argument("--rounds", type=int, default=1)
    parser.add_argument("--markdown", type=Path)
    options = parser.parse_args()
    found: list[Stretch] = []
    taken: list[float] = []
    names: list[str] = []
    at_random: list[list[str]] = []
    for path in captures(options.data):
        capture = am.read(path) if options.only in path.name else None
        if capture is None or not any(capture.names):
            continue
        names.append(path.name)
        truth = named_only(capture.tracks)
        for length in LENGTHS:
            for seed in range(options.rounds):
                stretches, ms = measure(path.name, truth, length, seed)
                found += stretches
                taken += [ms] * bool(stretches)
        at_random.append([path.name, *scattered(truth)])
        print(path.name, len(found), flush=True)
    head = ["frames occluded", "stretches", *WAYS, "spline / fill"]
    lines = ["RMS distance over all stretches, mm (median of the stretches):", ""]
    rows: list[list[str]] = []
    for which, wanted in (("bonded", {True}), ("all", {True, False})):
        for length in LENGTHS:
            some = [s for s in found if s.length == length and s.is_bonded in wanted]
            rows += [[f"{length}, {which}", *accuracy(some)]] if some else []
    lines += [*table(head, rows), ""]
    lines += ["Errors by their standard deviation, coordinate by coordinate:", ""]
    rows = []
    for which, wanted in (("tried", True), ("the take too short to try", False)):
        for length in LENGTHS:
            some = [s for s in found if s.length == length and s.is_tried is wanted]
            rows += [[f"{length}, {which}", *calibration(some)]] if some else []
    head = ["frames occluded", "stretches", "within 1 σ, %", "within 1.96 σ, %", "mean square"]
    lines += [*table(head, rows), ""]
    lines += ["By capture, of stretches that were tried:", ""]
    rows = []
    for name in names:
        some = [s for s in found if s.capture == name and s.is_tried]
        ratios = [
            "–" if not each else accuracy(each)[-1]
            for each in ([s for s in some if s.length == length] for length in LENGTHS)
        ]
        rows += [[name, *ratios, *calibration(some)[1:]]] if some else []
    head = ["capture", *(f"spline / fill, {n}" for n in LENGTHS), *head[2:]]
    lines += [*table(head, rows), ""]
    lines += [
        f"{100 * SCATTERED:.0f} % of the points of {EXCERPT} frames missing at random, mm:",
        "",
    ]
    head = ["capture", "gaps", "tried, %", "fill", "spline", "within 1.96 σ, %", "mean square"]
    lines += [*table([*head, "largest σ"], at_random), ""]
    lines += [f"{np.median(taken):.0f} ms of processor time a gap. {conditions()}."]
    publish(lines, options.markdown)


if __name__ == "__main__":
    main()
