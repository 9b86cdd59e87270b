"""Links in a race at half rate: markers that move further than the distance to their neighbours.

The capture of a racing wheelchair in ``../shared/data`` (or ``--data``), at half rate with 10 %
missing, 10 % clutter and 0.3 mm of noise. Compared are the nearest detection to the position that
constant velocity predicts from the true detections of the two frames before, TOMHT, and TOMHT with
bonds and the motion that bonds give, both stitched. A link is right if the detection before it in
the track is of the same marker. The picture is of the frame with most predictions nearest to
another marker.

    python benchmarks/racing.py [--data FOLDER] [--picture FILE] [--markdown FILE]
"""

from __future__ import annotations

import argparse
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np

import asterism as am
from asterism.tracking import Rigidity
from asterism.tracking.estimation import fit_body_motion
from captures import captures
from identity import half_rate
from report import conditions, publish, table

if TYPE_CHECKING:
    from numpy.typing import NDArray

NAME = "kinematics_racing_full.c3d"
RIGHT, WRONG, GREY = "#0072B2", "#D55E00", "#888888"


def before(tracks: am.Tracks) -> NDArray[np.int64]:
    """Return the detection before each in its track, -1 for none."""
    order, _ = tracks.by_track
    same = np.diff(tracks.labels[order]) == 0
    found = np.full(len(tracks.labels), -1)
    found[order[1:][same]] = order[:-1][same]
    return found


def right_links(tracks: am.Tracks, truth: am.Tracks) -> NDArray[np.bool_]:
    """Return for each detection whether its link to the detection before is right."""
    link = before(tracks)
    return (link >= 0) & (truth.labels >= 0) & (truth.labels[link] == truth.labels)


def draw(
    path: Path, places: NDArray[np.float64], t: int, is_nearest: NDArray[np.bool_],
    found: NDArray[np.float64], is_right: NDArray[np.bool_],
) -> None:  # fmt: skip
    """Draw a frame from above.

    Parameters
    ----------
    path : Path
        Picture to write.
    places : ndarray of shape (T, K, 3)
        Positions of the markers, NaN where they are not detected.
    t : int
        Frame.
    is_nearest : ndarray of bool, shape (K,)
        Whether the detection of a marker is nearest to its predicted position.
    found : ndarray of shape (K, 2, 3)
        Both ends of the link of each detection of the frame with bonds.
    is_right : ndarray of bool, shape (K,)
        Whether it is right.
    """
    from matplotlib.figure import Figure

    predicted, now = 2 * places[t - 1] - places[t - 2], places[t]
    figure = Figure(figsize=(11, 4.6), dpi=110, layout="constrained")
    both = figure.subplots(1, 2, sharex=True, sharey=True)
    links = np.stack([predicted, now], axis=1)
    known = np.isfinite(links).all(axis=(1, 2))
    linked = np.isfinite(found).all(axis=(1, 2))
    for k, (ends, good, used, title) in enumerate((
        (links, is_nearest, known, "Predicted by own motion (×): "
         f"{int((known & ~is_nearest).sum())} of {int(known.sum())} are nearest to another marker"),
        (found, is_right, linked, "TOMHT with bonds, from the position before (○): "
         f"{int((linked & is_right).sum())} of {int(linked.sum())} are right"),
    )):  # fmt: skip
        axes = both[k]
        axes.plot(*now[:, [0, 2]].T, "o", color=GREY, markersize=4)
        for (a, b), is_good in zip(ends[used][:, :, [0, 2]], good[used], strict=True):
            colour = RIGHT if is_good else WRONG
            axes.plot(*np.stack([a, b]).T, color=colour, linewidth=1.4)
            axes.plot(*a, "o" if k else "x", color=colour, markersize=6, fillstyle="none")
        axes.set(aspect="equal", xlabel="x, m", ylabel="z, m")
        axes.set_title(title, fontsize=9, loc="left")
    figure.savefig(path)


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__)
    beside = Path(__file__).resolve().parents[2] / "shared" / "data"
    parser.add_argument("--data", type=Path, default=beside)
    parser.add_argument("--picture", type=Path)
    parser.add_argument("--markdown", type=Path)
    options = parser.parse_args()
    path = next(path for path in captures(options.data) if path.name == NAME)
    truth = half_rate(am.read(path).tracks)
    d, places = truth.detections, truth.positions()
    predicted = 2 * places[1:-1] - places[:-2]
    distance = np.linalg.norm(predicted[:, :, None] - places[2:, None], axis=-1)
    nearest = np.where(np.isnan(distance), np.inf, distance).argmin(axis=2)
    known = np.isfinite(predicted).all(axis=2) & np.isfinite(places[2:]).all(axis=2)
    is_nearest = nearest == np.arange(places.shape[1])
    model = am.estimate_model(d).model
    made: dict[str, tuple[Any, am.TrackingModel]] = {"TOMHT": (am.TOMHT(), model)}
    if (fitted := fit_body_motion(d, model)) is not None:
        made["TOMHT with bonds"] = am.TOMHT(rigid=Rigidity()), fitted[0]
    rows = [["nearest to the prediction", f"{100 * is_nearest[known].mean():.1f} %"]]
    n_links = int((before(truth) >= 0).sum())
    tracks = truth
    for name, (method, own) in made.items():
        tracks = am.track(d, method, model=own, stitch=True)
        rows.append([name, f"{100 * right_links(tracks, truth).sum() / n_links:.1f} %"])
    if options.picture is not None:
        t = int((known & ~is_nearest).sum(axis=1).argmax()) + 2
        link, is_right = before(tracks), right_links(tracks, truth)
        ends = np.full((places.shape[1], 2, 3), np.nan)
        good = np.zeros(places.shape[1], dtype=bool)
        for i in np.flatnonzero((d.frame_of == t) & (truth.labels >= 0) & (link >= 0)):
            ends[truth.labels[i]] = d.points[link[i]], d.points[i]
            good[truth.labels[i]] = is_right[i]
        draw(options.picture, places, t, is_nearest[t - 2], ends, good)
    publish([*table(["link to", "right"], rows), "", conditions()], options.markdown)


if __name__ == "__main__":
    main()
