"""``asterism evaluate``: scores of labels against the truth."""

from __future__ import annotations

import csv
import io
from pathlib import Path
from typing import TYPE_CHECKING, Annotated

import typer

from asterism.cli.console import Json, Overwrite, Quiet, console, print_json
from asterism.errors import ParameterError

if TYPE_CHECKING:
    import asterism as am

_Labels = Annotated[Path, typer.Argument(metavar="LABELS", help="Tracks to score.")]
_Truth = Annotated[Path, typer.Argument(metavar="TRUTH", help="True tracks of the detections.")]
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

    For example:

        asterism evaluate trial.tracked.c3d truth.c3d

        asterism evaluate tracks.csv truth.c3d --json --by-frame frames.csv
    """
    import asterism as am
    from asterism.cli.outputs import check_outputs, read_labels

    check_outputs({"--by-frame": by_frame}, [labels, truth], overwrite=overwrite)
    found, true = read_labels(labels), am.io.read_tracks(truth)
    if not true.n_tracks:
        expected = "a capture whose markers are labelled"
        got = f"{truth}, which has no labels"
        raise ParameterError("TRUTH", expected, got, "the truth is the second of the two files")
    scores = am.evaluate(found, true)
    if by_frame is not None:
        _write_by_frame(scores, by_frame)
    if json:
        print_json(scores.to_dict())
    elif not quiet:
        console().print(str(scores), markup=False, soft_wrap=True)


def _write_by_frame(scores: am.metrics.Evaluation, path: Path) -> None:
    from asterism.io.atomic import write_text

    columns = scores.by_frame()
    text = io.StringIO()
    writer = csv.writer(text, lineterminator="\n")
    writer.writerow(columns)
    writer.writerows(zip(*(column.tolist() for column in columns.values()), strict=True))
    write_text(path, text.getvalue())
