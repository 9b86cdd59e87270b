"""Identity at falling frame rates: simulated people, by TOMHT, with bonds, and by default.

People who walk and run, 600 frames at 100 Hz, of which every second, fourth or sixth is kept; 10 %
missing, 10 % clutter, 0.3 mm of noise. “With bonds” is TOMHT with `Rigidity` and the motion of
`fit_body_motion`, stitched like TOMHT alone; “by default” is `track` without a method.

    python benchmarks/frame_rates.py [--seeds N …] [--markdown FILE]
"""

from __future__ import annotations

import argparse
from pathlib import Path

import numpy as np

import asterism as am
from asterism.tracking import Rigidity
from asterism.tracking.estimation import fit_body_motion
from report import conditions, publish, table

WAYS = ("TOMHT", "with bonds", "by default")
STRIDES = (2, 4, 6)
ACTIVITIES = ("walk", "run")


def scores(truth: am.Tracks) -> list[tuple[float, float]]:
    """Track in each way: IDF1 and switches for 1000 detections."""
    d = truth.detections
    model = am.estimate_model(d).model
    fitted = fit_body_motion(d, model)
    bodies = model if fitted is None else fitted[0]
    found = [am.track(d, am.TOMHT(), model=model, stitch=True)]
    found.append(am.track(d, am.TOMHT(rigid=Rigidity()), model=bodies, stitch=True))
    found.append(am.track(d))
    return [(e.idf1, e.switches_per_1000) for e in (am.evaluate(each, truth) for each in found)]


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--seeds", type=int, nargs="*", default=[11, 12, 13, 14, 15])
    parser.add_argument("--markdown", type=Path)
    args = parser.parse_args()
    rows: list[list[str]] = []
    for activity in ACTIVITIES:
        people = {s: am.simulate.person(activity=activity, frames=600, seed=s) for s in args.seeds}
        for stride in STRIDES:
            all_scores = []
            for seed, person in people.items():
                truth = am.simulate.corrupt(
                    person, missing=0.1, clutter=0.1, noise=3e-4, stride=stride, seed=seed
                )
                all_scores.append(scores(truth))
            mean, least = np.mean(all_scores, axis=0), np.min(all_scores, axis=0)
            cells = [
                f"{m[0]:.4f} ({m[1]:.2f}), {low[0]:.4f}" for m, low in zip(mean, least, strict=True)
            ]
            rows.append([activity, f"{100 / stride:.3g} Hz", *cells])
            print(*rows[-1], flush=True)
    head = ["people who", "rate", *(f"{w}: IDF1 (switches a 1000), least IDF1" for w in WAYS)]
    publish([*table(head, rows), "", f"{conditions()}."], args.markdown)


if __name__ == "__main__":
    main()
