"""Pictures hold what they are said to hold."""

from __future__ import annotations

import dataclasses
import io
import sys

import numpy as np
import pytest
from matplotlib.collections import PolyCollection
from matplotlib.colors import to_hex
from matplotlib.figure import Figure

import asterism as am
from asterism.plot import plot_errors, plot_presence, plot_trajectories
from asterism.plot.style import CLUTTER, CYCLE, RIGHT, WRONG


def tracks_of(table, n_axes=3, names=()):
    """Tracks from rows of frames: a digit is a track seen, a dot is nothing, a star is clutter."""
    labels, frames, rng = [], [], np.random.default_rng(1)
    for row in table:
        seen = [-1 if c == "*" else int(c) for c in row if c != "."]
        labels += seen
        frames.append(rng.normal(size=(len(seen), n_axes)))
    detections = am.Detections.from_frames(np.arange(len(table)) / 10, frames)
    return am.Tracks(detections=detections, labels=labels, names=names)


def bars_of(axes):
    """Every bar as (row, begin, end, colour), seconds."""
    (bars,) = (c for c in axes.collections if isinstance(c, PolyCollection))
    found = []
    for path, colour in zip(bars.get_paths(), bars.get_facecolors(), strict=True):
        low, high = path.vertices.min(axis=0), path.vertices.max(axis=0)
        found.append(
            (round((low[1] + high[1]) / 2), *np.round([low[0], high[0]], 9), to_hex(colour))
        )
    return sorted(found)


def test_presence_shows_every_gap_and_sorts_by_first_frame():
    tracks = tracks_of(["1*", "1", "0", "01", "**"])
    axes = plot_presence(tracks)
    one, two = CYCLE[0].lower(), CYCLE[1].lower()
    assert bars_of(axes) == [(0, -0.05, 0.15, two), (0, 0.25, 0.35, two), (1, 0.15, 0.35, one)]
    assert [t.get_text() for t in axes.get_yticklabels()] in (["0", "1"], ["1", "0"])
    assert axes.get_ylim()[0] > axes.get_ylim()[1]  # the first on top
    (above,) = axes.child_axes
    (counts,) = above.collections
    assert to_hex(counts.get_facecolor()) == CLUTTER.lower()
    assert counts.get_paths()[0].vertices[:, 1].max() == 2


def test_the_rows_bear_the_names_of_their_own_tracks():
    tracks = tracks_of(["1", "0", "2"], names=("A", "B", None))
    axes = plot_presence(tracks)
    at = {
        t.get_text(): round(y)
        for y, t in zip(axes.get_yticks(), axes.get_yticklabels(), strict=True)
    }
    assert at == {"B": 0, "A": 1, "2": 2}


def test_errors_are_coloured_by_the_marker_that_a_track_has_most_often():
    table = ["01", "01", "01", "01*"]
    tracks = tracks_of(table)
    right, wrong = RIGHT.lower(), WRONG.lower()
    truth = [0, 1, 0, 1, 1, 0, 0, -1, 1]  # swapped in frame 2; clutter labelled in frame 3
    axes = plot_errors(tracks, am.Tracks(detections=tracks.detections, labels=truth))
    assert bars_of(axes) == [
        (0, -0.05, 0.15, right), (0, 0.15, 0.25, wrong), (0, 0.25, 0.35, right),
        (1, -0.05, 0.15, right), (1, 0.15, 0.35, wrong),
    ]  # fmt: skip
    (above,) = axes.child_axes
    assert above.get_xlabel() == "38 % of the labels wrong"
    labels = [text.get_text() for text in above.get_legend().get_texts()]
    assert labels == ["no label", "wrong marker", "right marker"]
    tops = [c.get_paths()[0].vertices[:, 1].max() for c in above.collections]
    assert tops == [2, 2]  # in frame 2 both, in frame 3 one wrong and one without a label


def test_a_track_of_clutter_is_wrong_throughout():
    tracks = tracks_of(["0", "0"])
    axes = plot_errors(tracks, am.Tracks(detections=tracks.detections, labels=[-1, -1]))
    assert {colour for *_, colour in bars_of(axes)} == {WRONG.lower()}


def test_errors_need_the_same_detections():
    tracks, other = tracks_of(["01", "01"]), tracks_of(["01", "0", "1"])
    with pytest.raises(am.ParameterError, match="align"):
        plot_errors(tracks, other)


@pytest.mark.parametrize("n_axes", [2, 3])
def test_paths_break_where_a_track_was_not_seen(n_axes):
    tracks = tracks_of(["0*", "0", "", "01", "1"], n_axes=n_axes)
    axes = plot_trajectories(tracks)
    lines = [line for line in axes.lines if line.get_linestyle() == "-"]
    paths = [line.get_data_3d() if n_axes == 3 else line.get_data() for line in lines]
    assert [np.isnan(path[0]).tolist() for path in paths] == [
        [False, False, True, False],
        [False, False],
    ]
    points = tracks.detections.points[tracks.labels == 1]
    np.testing.assert_array_equal(np.stack(paths[1], axis=1), points)
    assert [to_hex(line.get_color()) for line in lines] == [c.lower() for c in CYCLE[:2]]
    assert "tracks: 2, clutter: 1" in axes.get_title(loc="left")


def test_all_axes_have_one_scale():
    rng = np.random.default_rng(2)
    points = rng.uniform(size=(50, 1, 3)) * [4.0, 2.0, 1.0]
    axes = plot_trajectories(am.Tracks.from_dense(np.arange(50), points))
    spans = np.array([np.ptp(limits()) for limits in (axes.get_xlim, axes.get_ylim, axes.get_zlim)])
    box = axes._box_aspect
    np.testing.assert_allclose(spans / box, np.full(3, spans[0] / box[0]))


@pytest.mark.parametrize("part", ["figure", "half", "subfigure"])
@pytest.mark.parametrize("kind", ["presence", "errors", "confidence"])
def test_the_title_is_the_callers_own_and_nothing_lies_on_it(kind, part):
    tracks = tracks_of(["01", "01*", "0", "01"])
    tracks = dataclasses.replace(tracks, confidence=np.ones(len(tracks.labels)))
    figure = Figure(figsize=(8, 7), layout=None if part == "figure" else "constrained")
    if part == "subfigure":  # which has neither a height in inches nor a canvas
        ax = figure.subfigures(1, 2, wspace=0.1)[0].add_subplot()
    else:
        ax = figure.add_subplot(*((2, 1, 2) if part == "half" else ()))
    draw = {"presence": plot_presence, "confidence": am.plot.plot_confidence,
            "errors": lambda t, ax: plot_errors(t, t, ax=ax)}[kind]  # fmt: skip
    axes = draw(tracks, ax=ax)
    axes.set_title("A title of the caller, as long as titles are in papers")
    figure.draw_without_rendering()
    (above,) = axes.child_axes
    title = axes.title.get_window_extent()
    below = [above.get_window_extent(), above.xaxis.label.get_window_extent()]
    below += [legend.get_window_extent() for legend in [above.get_legend()] if legend]
    assert above.get_xlabel()
    assert all(title.y0 >= box.y1 for box in below)
    strip, main = above.get_window_extent(), axes.get_window_extent()
    inches = np.array([strip.y0 - main.y1, strip.height]) / figure.dpi
    np.testing.assert_allclose(inches, [0.1, 0.55], atol=0.02)
    np.testing.assert_allclose([strip.x0, strip.x1], [main.x0, main.x1], atol=1)
    assert am.plot.figure_bytes(axes, "png")[1:4] == b"PNG"  # of the whole figure


ODD = pytest.mark.parametrize(
    "table", [[], ["", ""], ["*", "*"], ["0"], ["0", "", "0"], ["3", "3"]]
)


@ODD
@pytest.mark.parametrize("n_axes", [2, 3])
def test_positions_of_odd_tracks_can_be_drawn(table, n_axes):
    tracks = tracks_of(table, n_axes=n_axes)
    for axes in (plot_trajectories(tracks), plot_errors(tracks, tracks)):
        axes.figure.draw_without_rendering()


@ODD
def test_the_presence_of_odd_tracks_can_be_drawn(table):
    plot_presence(tracks_of(table)).figure.draw_without_rendering()


@pytest.mark.parametrize("ending", ["png", "svg", "pdf"])
def test_every_picture_can_be_exported(ending):
    tracks = tracks_of(["01*", "01", "1"])
    for axes in (plot_trajectories(tracks), plot_presence(tracks), plot_errors(tracks, tracks)):
        file = io.BytesIO()
        axes.figure.savefig(file, format=ending)
        assert file.tell() > 1000


def test_given_axes_are_drawn_on_and_given_back():
    tracks = tracks_of(["01*", "01"])
    figure = Figure(layout="constrained")
    flat = figure.subplots(2)
    assert plot_presence(tracks, flat[0]) is flat[0]
    assert plot_errors(tracks, tracks, ax=flat[1]) is flat[1]
    solid = Figure().add_subplot(projection="3d")
    assert plot_trajectories(tracks, solid) is solid
    figure.savefig(io.BytesIO())


def test_no_global_state():
    import subprocess

    script = (
        "import sys, asterism as am\n"
        "from asterism.plot import plot_presence, plot_trajectories\n"
        "assert 'matplotlib' not in sys.modules\n"
        "truth = am.simulate.cube()\n"
        "plot_presence(truth), plot_trajectories(truth)\n"
        "assert 'matplotlib.pyplot' not in sys.modules\n"
    )
    subprocess.run([sys.executable, "-c", script], check=True, timeout=60)
