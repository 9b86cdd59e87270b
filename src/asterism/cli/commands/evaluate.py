"""``asterism evaluate``: scores of labels against the truth."""

from __future__ import annotations

import csv
import io
from pathlib import Path, PurePosixPath
from typing import TYPE_CHECKING, Annotated

import typer

from asterism.cli.console import (
    Json,
    Overwrite,
    Quiet,
    console,
    print_json,
    print_table,
    progress,
)
from asterism.errors import ParameterError

if TYPE_CHECKING:
    import asterism as am

_Labels = Annotated[Path, typer.Argument(metavar="LABELS", help="Tracks to score, or a folder.")]
_Truth = Annotated[Path, typer.Argument(metavar="TRUTH", help="True tracks, or a folder.")]
_ByFrame = Annotated[
    Path | None, typer.Option(metavar="FILE.csv", help="Write the scores frame by frame.")
]


def evaluate(
    labels: _Labels,
    truth: _Truth,
    by_frame: _ByFrame = None,
    overwrite: Overwrite = False,
    quiet: Quiet = False,
    json: Json = False,
) -> None:
    """Score tracks against the truth: IDF1, MOTA, HOTA and identity switches.

    Both files must hold the same detections, in any format; detections are matched by time and
    position. In the truth, points without a name are clutter. In the tracks they are clutter only
    where the format cannot mark clutter (TRC, TSV, CSV with one row per frame). Names are scored
    if both files have any.

    In folders, ``walk.tracked.c3d`` is compared with ``walk.c3d``, whatever their formats; the
    figures of all are one table.

    For example:

        asterism evaluate trial.tracked.c3d truth.c3d

        asterism evaluate tracks.csv truth.c3d --json --by-frame frames.csv

        asterism evaluate tracked truths
    """
    from asterism.cli.outputs import check_outputs

    check_outputs({"--by-frame": by_frame}, [labels, truth], overwrite=overwrite)
    if labels.is_dir() or truth.is_dir():
        if by_frame is not None:
            raise ParameterError("--by-frame", "two files", "folders")
        _evaluate_folders(labels, truth, quiet=quiet, json=json)
        return
    scores = _scores(labels, truth)
    if by_frame is not None:
        _write_by_frame(scores, by_frame)
    if json:
        print_json(scores.to_dict())
    elif not quiet:
        console().print(str(scores), markup=False, soft_wrap=True)


def _scores(labels: Path, truth: Path) -> am.metrics.Evaluation:
    """Return the scores of one file against the other."""
    import asterism as am
    from asterism.cli.outputs import read_labels

    found, true = read_labels(labels), am.io.read_tracks(truth)
    if not true.n_tracks:
        expected = "a capture whose markers are labelled"
        got = f"{truth}, which has no labels"
        raise ParameterError("TRUTH", expected, got, "the truth is the second of the two files")
    return am.evaluate(found, true)


def _evaluate_folders(labels: Path, truth: Path, *, quiet: bool, json: bool) -> None:
    """Score all captures of a folder, and print one row for each."""
    pairs = _pairs(labels, truth)
    with progress("scoring", len(pairs)) as advance:
        scores: dict[str, am.metrics.Evaluation] = {}
        for n, (name, (found, true)) in enumerate(pairs.items()):
            scores[name] = _scores(found, true)
            advance(n + 1)
    if json:
        print_json({"captures": {name: each.to_dict() for name, each in scores.items()}})
        return
    values = [(each.idf1, each.mota, each.hota) for each in scores.values()]
    switches = [each.switches for each in scores.values()]
    means = [sum(column) / len(column) for column in zip(*values, strict=True)]
    rows = [
        (name, *(f"{score:.4f}" for score in row), n)
        for name, row, n in zip(
            [*scores, "mean"], [*values, means], [*switches, sum(switches)], strict=True
        )
    ]
    if not quiet:
        print_table(rows, ("capture", "IDF1", "MOTA", "HOTA", "switches"))


def _pairs(labels: Path, truth: Path) -> dict[str, tuple[Path, Path]]:
    """Return the captures of two folders that belong together, by name."""
    from asterism.batch.find import captures_below

    for name, folder in (("LABELS", labels), ("TRUTH", truth)):
        if not folder.is_dir():
            raise ParameterError(name, "a folder, as the other is one", str(folder))
    true = {_stem(name): truth / name for name in captures_below(str(truth))}
    pairs = {
        _stem(name): (labels / name, true[_stem(name)])
        for name in captures_below(str(labels))
        if _stem(name) in true
    }
    if not pairs:
        hint = "walk.tracked.c3d is compared with walk.c3d"
        raise ParameterError("TRUTH", f"captures with the names of those in {labels}", truth, hint)
    return pairs


def _stem(name: str) -> str:
    return str(PurePosixPath(name).with_suffix("")).removesuffix(".tracked")


def _write_by_frame(scores: am.metrics.Evaluation, path: Path) -> None:
    from asterism.io.atomic import write_text

    columns = scores.by_frame()
    text = io.StringIO()
    writer = csv.writer(text, lineterminator="\n")
    writer.writerow(columns)
    writer.writerows(zip(*(column.tolist() for column in columns.values()), strict=True))
    write_text(path, text.getvalue())
