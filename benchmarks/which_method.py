"""What the choice of the clip is worth: `auto` beside every single default, on scenes and captures.

The scenes of `scenes.py`, also through four cameras, and the captures of `identity.py` in its four
conditions; GNN, SMP over three frames, TOMHT and MCMCDA, alone and stitched.

    python benchmarks/which_method.py [--seeds N] [--data FOLDER] [--points N] [--markdown FILE]
"""

from __future__ import annotations

import argparse
from collections import Counter
from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np

import asterism as am
from captures import captures
from identity import CONDITIONS
from report import conditions, publish, table
from scenes import studies

if TYPE_CHECKING:
    from collections.abc import Iterator, Sequence

METHODS: dict[str, am.tracking.Method[Any]] = {
    "gnn": am.GNN(),
    "smp, window=3": am.SMP(window=3),
    "tomht": am.TOMHT(),
    "mcmcda": am.MCMCDA(),
}
WAYS = [way for name in METHODS for way in (name, f"{name}, stitched")]


@dataclass(frozen=True, kw_only=True)
class Row:
    """IDF1 of every way on one clip, and the way that the clip chooses."""

    group: str
    idf1: dict[str, float]
    chosen: str


def row_of(group: str, truth: am.Tracks) -> Row:
    d = truth.detections
    model = am.estimate_model(d).model
    idf1: dict[str, float] = {}
    for name, method in METHODS.items():
        idf1[name] = am.evaluate(am.track(d, method, model=model, seed=0), truth).idf1
        stitched = am.track(d, method, model=model, seed=0, stitch=True)
        idf1[f"{name}, stitched"] = am.evaluate(stitched, truth).idf1
    recipe = am.track(d, model=model, seed=0).recipe
    assert recipe is not None
    return Row(group=group, idf1=idf1, chosen=way_of(recipe.method, recipe.stitch))


def way_of(method: str, stitch: bool) -> str:
    """Name a choice as the columns do."""
    name = "smp, window=3" if method == "smp" else method
    return f"{name}, stitched" if stitch else name


def clips(seeds: int, data: Path, points: int) -> Iterator[tuple[str, am.Tracks]]:
    for study in studies(range(seeds), {"auto": {"method": "auto"}}).values():
        for case in study.cases():
            yield "scenes", am.sweep.truth_of(case)
    for path in captures(data):
        capture = am.read(path)
        if any(capture.names) and capture.n_points <= points:
            for condition, make in CONDITIONS.items():
                yield f"captures, {condition}", make(capture.tracks)


def page(rows: Sequence[Row]) -> list[str]:
    """Give the lines of the page: a row for each group, and one over all clips."""
    groups = list(dict.fromkeys(row.group for row in rows))
    lines: list[list[str]] = []
    for group in [*groups, "**all clips**"]:
        mine = [row for row in rows if row.group == group] or list(rows)
        means = [float(np.mean([row.idf1[way] for row in mine])) for way in WAYS]
        auto = float(np.mean([row.idf1[row.chosen] for row in mine]))
        took = Counter(row.chosen for row in mine)
        chosen = "; ".join(f"{way}: {n}" for way, n in took.most_common())
        lines.append([group, str(len(mine)), *(f"{v:.4f}" for v in (*means, auto)), chosen])
    return table(["", "clips", *WAYS, "auto", "chosen"], lines)


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__)
    beside = Path(__file__).resolve().parents[2] / "shared" / "data"
    parser.add_argument("--seeds", type=int, default=2)
    parser.add_argument("--data", type=Path, default=beside)
    parser.add_argument("--points", type=int, default=200_000, help="at most, of a capture")
    parser.add_argument("--markdown", type=Path)
    options = parser.parse_args()
    rows: list[Row] = []
    for group, truth in clips(options.seeds, options.data, options.points):
        rows.append(row_of(group, truth))
        print(group, rows[-1].chosen, rows[-1].idf1, sep=" | ", flush=True)
    lines = ["Mean IDF1:", "", *page(rows), "", f"{options.seeds} seeds of each scene; "]
    lines[-1] += f"captures of at most {options.points:,} points. {conditions()}."
    publish(lines, options.markdown)


if __name__ == "__main__":
    main()
