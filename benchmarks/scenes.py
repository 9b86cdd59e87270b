"""Every scene, tracked by every method with the estimated model: three sweeps.

10 % of the detections missing, 10 % clutter, noise of 5 mm for the scenes of points and 0.3 mm for
those in metres and seconds. People are tracked a second time from what two or more of four cameras
see past their limbs.

    python benchmarks/scenes.py [--seeds N] [--folder FOLDER] [--markdown FILE]

Scores of finished cases are kept in FOLDER, so an interrupted benchmark goes on where it ended.
"""

from __future__ import annotations

import argparse
from pathlib import Path
from typing import TYPE_CHECKING, Any

import asterism as am
from report import conditions, publish, table

if TYPE_CHECKING:
    from collections.abc import Sequence

POINTS: dict[str, dict[str, Any]] = {
    "cube": {"scene": "cube"},
    "crossing": {"scene": "crossing"},
    "wander": {"scene": "wander"},
    "walk": {"scene": "walk"},
    "attracted": {"scene": "attracted"},
    "smooth, 50": {"scene": "smooth", "n_markers": 50, "frames": 200},
    "smooth, 200": {"scene": "smooth", "n_markers": 200, "frames": 100},
}
PEOPLE: dict[str, dict[str, Any]] = {
    "person walks": {"scene": "person", "activity": "walk"},
    "person runs": {"scene": "person", "activity": "run"},
    "person jumps": {"scene": "person", "activity": "jump"},
    "person turns": {"scene": "person", "activity": "turn"},
    "two people cross": {"scene": "two_people", "activity": "cross"},
    "two people hug": {"scene": "two_people", "activity": "hug"},
    "juggler": {"scene": "juggler"},
}
METRES = {"swarm": {"scene": "swarm"}, "fingers": {"scene": "fingers"}, **PEOPLE}
METHODS: dict[str, dict[str, Any]] = {
    "gnn": {"method": "gnn"},
    "smp": {"method": "smp"},
    "smp, window=3": {"method": "smp", "window": 3},
    "jpda": {"method": "jpda"},
    "splitting": {"method": "splitting"},
    "tomht": {"method": "tomht"},
    "mht": {"method": "mht"},
    "mcmcda": {"method": "mcmcda"},
}
COMMON = {"missing": 0.1, "clutter": 0.1}


def studies(
    seeds: Sequence[int], methods: dict[str, dict[str, Any]] = METHODS
) -> dict[str, am.sweep.Study]:
    """Return the studies by their names."""
    given: dict[str, Any] = {"methods": methods, "seeds": tuple(seeds)}
    given["scores"] = ("idf1", "switches_per_1000")
    bodies = {**COMMON, "noise": 3e-4}
    return {
        "points": am.sweep.Study(
            scenes=POINTS, corruptions={"5 mm": {**COMMON, "noise": 0.005}}, **given
        ),
        "metres": am.sweep.Study(scenes=METRES, corruptions={"0.3 mm": bodies}, **given),
        "cameras": am.sweep.Study(
            scenes=PEOPLE, corruptions={"4 cameras": {**bodies, "cameras": 4}}, **given
        ),
    }


def rows_of(sweep: am.sweep.Sweep) -> list[list[str]]:
    """Return a row for each scene with a figure for each method."""
    cells: dict[str, dict[str, str]] = {}
    for each in sweep.summary:
        seen = ", 4 cameras" if each["corruption"] == "4 cameras" else ""
        half = (each["idf1_high"] - each["idf1_low"]) / 2
        figure = f"{each['idf1']:.3f} ± {half:.3f} ({each['switches_per_1000']:.1f})"
        cells.setdefault(each["scene"] + seen, {})[each["method"]] = figure
    return [[scene, *(row[name] for name in METHODS)] for scene, row in cells.items()]


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--seeds", type=int, default=5)
    parser.add_argument("--folder", type=Path, default=Path("build/scenes"))
    parser.add_argument("--markdown", type=Path)
    options = parser.parse_args()
    rows: list[list[str]] = []
    for name, study in studies(range(options.seeds)).items():
        sweep = am.sweep.run(study, options.folder / name)
        assert not sweep.failed, sweep.failed
        rows += rows_of(sweep)
    lines = ["IDF1 ± half of its 95 % confidence interval, and switches for 1000 detections:", ""]
    lines += [*table(["scene", *METHODS], rows), ""]
    publish([*lines, f"Means over {options.seeds} seeds. {conditions()}."], options.markdown)


if __name__ == "__main__":
    main()
