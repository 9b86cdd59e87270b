"""Figures of results hold what they are said to hold."""

from __future__ import annotations

import dataclasses
import io
import subprocess
import sys
import time

import numpy as np
import pytest
from matplotlib.collections import PolyCollection, QuadMesh
from matplotlib.colors import to_hex
from matplotlib.figure import Figure

import asterism as am
from asterism.plot.style import CLUTTER, CYCLE


def tracks_of(table, n_axes=3, sure=None):
    """Tracks from rows of frames: a digit is a track seen, a dot is nothing, a star is clutter."""
    labels, frames, rng = [], [], np.random.default_rng(1)
    for row in table:
        seen = [-1 if c == "*" else int(c) for c in row if c != "."]
        labels += seen
        frames.append(rng.normal(size=(len(seen), n_axes)))
    detections = am.Detections.from_frames(np.arange(len(table)) / 10, frames)
    if sure is None:
        sure = rng.uniform(size=len(labels))
    return am.Tracks(detections=detections, labels=labels, confidence=sure)


def group_sizes(groups):
    return list(zip(groups.frames.tolist(), groups.n_tracks.tolist(), groups.n_detections.tolist(),
                    strict=True))  # fmt: skip


@pytest.mark.parametrize("n_axes", [2, 3])
def test_axes_show_each_coordinate_and_break_at_gaps(n_axes):
    tracks = tracks_of(["0*", "01", "", "0", "0"], n_axes=n_axes)
    panels = am.plot.plot_axes(tracks)
    assert [p.get_ylabel() for p in panels] == ["x [m]", "y [m]", "z [m]"][:n_axes]
    d = tracks.detections
    for i, axes in enumerate(panels):
        path, alone = axes.lines[0], axes.lines[2]
        own = tracks.labels == 0
        np.testing.assert_array_equal(
            path.get_ydata(), np.insert(d.points[own, i], 2, np.nan), strict=True
        )
        np.testing.assert_array_equal(
            path.get_xdata(), np.insert(d.times[d.frame_of[own]], 2, np.nan)
        )
        # Track 1 is one detection: a line would not show it.
        assert alone.get_marker() == "."
        np.testing.assert_array_equal(alone.get_ydata(), d.points[tracks.labels == 1, i])
        dots = axes.collections[0]
        np.testing.assert_array_equal(
            dots.get_offsets(), np.stack([[0.0], d.points[tracks.labels < 0, i]], axis=1)
        )
        assert to_hex(dots.get_facecolor()[0]) == CLUTTER.lower()


def test_confidence_shades_each_label_where_it_is():
    sure = [0.9, 0.5, 0.8, 0.1, 0.3, 1.0]
    tracks = tracks_of(["1*", "1", "0", "01"], sure=sure)
    axes = am.plot.plot_confidence(tracks)
    (mesh,) = (c for c in axes.collections if isinstance(c, QuadMesh))
    nan = np.nan
    # Track 1 comes first, in the upper row; clutter has no row.
    expected = [[0.9, 0.8, nan, 1.0], [nan, nan, 0.1, 0.3]]
    np.testing.assert_array_equal(np.ma.filled(mesh.get_array(), nan), expected)
    assert mesh.get_clim() == (0, 1)
    np.testing.assert_allclose(mesh.get_coordinates()[0, :, 0], [-0.05, 0.05, 0.15, 0.25, 0.35])
    (above,) = axes.child_axes
    least, mean = above.lines
    np.testing.assert_allclose(mean.get_ydata(), [0.9, 0.8, 0.1, 0.65])
    np.testing.assert_allclose(least.get_ydata(), [0.9, 0.8, 0.1, 0.3])


def test_confidence_must_be_there():
    truth = am.simulate.cube(seed=1)
    with pytest.raises(am.ParameterError, match=r"tracks with a confidence of links"):
        am.plot.plot_confidence(truth)
    with pytest.raises(am.ParameterError, match=r"tracks with a confidence of identities"):
        am.plot.plot_identity(truth)


def test_reliability_shows_the_bins_and_how_few_labels_tell():
    part = am.metrics.calibration_curve([0.95] * 98 + [0.15, 0.15], [True] * 98 + [True, False])
    axes = am.plot.plot_reliability({"a": part})
    bars = axes.containers[0]
    points, _, (spread,) = bars.lines
    np.testing.assert_allclose(points.get_xydata(), [[0.15, 0.5], [0.95, 1.0]])
    heights = [np.ptp(np.asarray(s)[:, 1]) for s in spread.get_segments()]
    assert heights[0] > 0.5  # of two labels
    assert 0 < heights[1] < 0.02  # of 98, all right: still not certain
    (above,) = axes.child_axes
    np.testing.assert_array_equal(above.patches[0].get_data().values, part.counts)
    assert f"a: error {part.ece:.3f}" in [t.get_text() for t in axes.get_legend().get_texts()]
    alone = am.plot.plot_reliability(part)
    assert f"error {part.ece:.3f}" in [t.get_text() for t in alone.get_legend().get_texts()]
    with pytest.raises(am.ParameterError, match="at least one"):
        am.plot.plot_reliability({})


def test_compare_draws_the_scores_and_the_time():
    truth = am.simulate.cube(seed=1)
    swapped = truth.labels.copy()
    late = truth.detections.frame_of >= truth.detections.n_frames // 2
    swapped[late & (truth.labels < 2)] = 1 - swapped[late & (truth.labels < 2)]
    worse = am.Tracks(detections=truth.detections, labels=swapped)
    scores = {"right": am.evaluate(truth, truth), "swapped": am.evaluate(worse, truth)}
    panels = am.plot.plot_compare(scores, milliseconds={"swapped": 0.25})
    widths = [[round(bar.get_width(), 9) for bar in axes.patches] for axes in panels]
    assert widths[0] == [1.0, round(scores["swapped"].idf1, 9)]
    assert widths[1] == [0, scores["swapped"].switches]
    assert scores["swapped"].switches == 2
    last = panels[2].patches[1]
    assert last.get_x() + last.get_width() == pytest.approx(0.25)
    assert [t.get_text() for t in panels[0].get_yticklabels()] == ["right", "swapped"]
    assert [t.get_text() for t in panels[2].texts] == ["–", "0.25"]
    assert len(am.plot.plot_compare(scores)) == 2
    for wrong in ({"absent": 1.0}, {"right": 0.0}):
        with pytest.raises(am.ParameterError, match="milliseconds"):
            am.plot.plot_compare(scores, milliseconds=wrong)
    with pytest.raises(am.ParameterError, match="at least one"):
        am.plot.plot_compare({})


def test_posterior_is_measured_from_the_best_of_all():
    axes = am.plot.plot_posterior([0, 1, 10], [[0, 80, 98], [0, 90, 100]], others={"gnn": 104})
    one, other, mean, gnn = axes.lines
    np.testing.assert_allclose(one.get_ydata(), [-104, -24, -6])
    np.testing.assert_allclose(other.get_ydata(), [-104, -14, -4])
    np.testing.assert_allclose(mean.get_ydata(), [-104, -19, -5])
    np.testing.assert_allclose(gnn.get_ydata(), 0)
    assert "after 10 moves 5.00 nats below" in axes.get_title(loc="left")
    assert [t.get_text() for t in axes.get_xticklabels()] == ["0", "1", "10"]
    low, high = axes.get_ylim()
    assert low < -104
    assert high > 0


def test_a_forbidden_partition_is_left_out_of_the_posterior():
    axes = am.plot.plot_posterior([1, 2], [[-np.inf, 5.0], [4.0, 6.0]])
    *_, mean = axes.lines
    np.testing.assert_array_equal(mean.get_ydata(), [np.nan, -0.5])
    am.plot.plot_posterior([1], [-np.inf]).figure.draw_without_rendering()
    for moves, values in (([], []), ([2, 1], [1, 2]), ([-1], [1]), ([1, 2], [1, 2, 3])):
        with pytest.raises(am.ParameterError):
            am.plot.plot_posterior(moves, values)


def model_of(noise=0.001):
    return am.TrackingModel(
        motion=am.RandomWalk(walk_sigma=1e-6),
        sensor=am.Sensor(noise_sigma=noise, p_detection=0.9, clutter_density=1.0),
        population=am.Population(birth_density=0.1, p_disappear=0.01, max_speed=1.0, max_gap=3),
    )


def still(*places, frames=3, extra=()):
    """Markers that stand still on a line, and clutter in every frame but the first."""
    times = np.arange(frames) / 100
    points = np.zeros((frames, len(places) + len(extra), 3))
    points[:, :, 0] = [*places, *extra]
    points[0, len(places) :] = np.nan
    made = am.Tracks.from_dense(times, points)
    labels = np.where(made.labels < len(places), made.labels, -1)
    return am.Tracks(detections=made.detections, labels=labels)


def test_groups_are_tracks_and_detections_that_gates_link():
    # Alone; two within each other's gates; two that one false point links, which lies between.
    tracks = still(0.0, 1.0, 1.004, 2.0, 2.015, extra=(2.0075,))
    found = am.filter.gate_groups(tracks, model_of())
    assert sorted(group_sizes(found)) == [
        (t, n_tracks, n) for t in (1, 2) for n_tracks, n in ((1, 1), (2, 2), (2, 3))
    ]
    np.testing.assert_array_equal(found.largest, [0, 2, 2])
    tight = am.filter.gate_groups(tracks, model_of(), gate_probability=0.5)
    assert {(n, m) for _, n, m in group_sizes(tight)} == {(1, 1)}
    with pytest.raises(am.ParameterError, match="gate_probability"):
        am.filter.gate_groups(tracks, model_of(), gate_probability=1)


def test_a_track_in_a_gap_is_a_group_without_a_detection():
    times = np.arange(4) / 100
    places = np.zeros((4, 1, 3))
    places[1] = np.nan
    found = am.filter.gate_groups(am.Tracks.from_dense(times, places), model_of())
    assert group_sizes(found) == [(1, 1, 0), (2, 1, 1), (3, 1, 1)]
    none = am.filter.gate_groups(
        am.Tracks.from_dense(times, np.full((4, 1, 3), np.nan)), model_of()
    )
    assert group_sizes(none) == []
    assert none.largest.tolist() == [0] * 4


def test_groups_are_stacked_by_size():
    tracks = still(0.0, 1.0, 1.004, 2.0, 2.015, extra=(2.0075,))
    axes = am.plot.plot_groups(am.filter.gate_groups(tracks, model_of()))
    shares = [c for c in axes.collections if isinstance(c, PolyCollection)]
    tops = [c.get_paths()[0].vertices[:, 1].max() for c in shares]
    assert tops == [4, 5]  # four in pairs, on these one alone
    texts = [t.get_text() for t in axes.get_legend().get_texts()]
    assert texts == ["1 track", "2"]
    assert "20 % of the tracks alone, at most 2 in a group" in axes.get_title(loc="left")


def test_projections_show_what_each_camera_saw():
    rig = am.Rig.ring(3, radius=4, height=2)
    shot = am.simulate.film(am.simulate.cube(frames=10, seed=1), rig)
    o = shot.observations
    panels = am.plot.plot_projections(o, rig, frames=slice(2, 4))
    assert len(panels) == 3
    for c, axes in enumerate(panels):
        (dots,) = axes.collections
        seen = np.concatenate([o.points(t, c) for t in (2, 3)])
        drawn = np.asarray(dots.get_offsets())
        np.testing.assert_array_equal(np.sort(drawn, axis=0), np.sort(seen, axis=0))
        whose = o.markers[(o.camera_of == c) & np.isin(o.frame_of, (2, 3))]
        colours = [to_hex(colour) for colour in dots.get_facecolor()]
        assert colours == [CYCLE[k % len(CYCLE)].lower() for k in whose]
        assert axes.get_title(loc="left") == f"cam{c + 1}: {len(seen)} points"
        assert axes.get_ylim()[0] > axes.get_ylim()[1]  # v down
    with pytest.raises(am.ParameterError, match="cameras of the film"):
        am.plot.plot_projections(o, am.Rig.ring(2, radius=4, height=2))


ODD = pytest.mark.parametrize(
    "table", [[], ["", ""], ["*", "*"], ["0"], ["0", "", "0"], ["3", "3"]]
)


@ODD
@pytest.mark.parametrize("n_axes", [2, 3])
def test_coordinates_of_odd_tracks_can_be_drawn(table, n_axes):
    am.plot.plot_axes(tracks_of(table, n_axes=n_axes))[0].figure.draw_without_rendering()


@ODD
def test_labels_of_odd_tracks_can_be_drawn(table):
    tracks = tracks_of(table)
    groups = am.filter.gate_groups(tracks, model_of())
    for drawn in (am.plot.plot_confidence(tracks), am.plot.plot_groups(groups)):
        drawn.figure.draw_without_rendering()


def test_given_axes_are_drawn_on_and_given_back():
    tracks = tracks_of(["01*", "01"])
    flat = Figure().subplots(3)
    assert am.plot.plot_axes(tracks, flat) == list(flat)
    with pytest.raises(am.ParameterError, match="ax: expected 3 axes"):
        am.plot.plot_axes(tracks, flat[:2])
    one = Figure().add_subplot()
    part = am.metrics.calibration_curve([0.5], [True])
    groups = am.filter.gate_groups(tracks, model_of())
    for plot, data in (
        (am.plot.plot_confidence, tracks), (am.plot.plot_reliability, part),
        (am.plot.plot_groups, groups),
    ):  # fmt: skip
        one = Figure().add_subplot()
        assert plot(data, ax=one) is one
    one = Figure().add_subplot()
    assert am.plot.plot_posterior([1], [2], ax=one) is one
    scores = {"a": am.evaluate(am.simulate.cube(seed=1), am.simulate.cube(seed=1))}
    two = list(Figure().subplots(1, 2))
    assert am.plot.plot_compare(scores, ax=two) == two


def test_the_same_picture_gives_the_same_bytes():
    tracks = tracks_of(["01*", "01", "1"])

    def made():
        panels = am.plot.plot_axes(tracks)
        return {ending: am.plot.figure_bytes(panels, ending) for ending in ("png", "svg", "pdf")}

    first = made()
    time.sleep(1.1)  # a date in them would have changed
    second = made()
    for ending, data in first.items():
        assert second[ending] == data, ending
        for word in (b"CreationDate", b"<dc:date>", b"Matplotlib v", b"matplotlib.org"):
            assert word not in data, ending


def test_figure_bytes_takes_figures_axes_and_lists():
    tracks = tracks_of(["01", "01"])
    expected = am.plot.figure_bytes(am.plot.plot_presence(tracks), "svg")
    assert am.plot.figure_bytes(am.plot.plot_presence(tracks).figure, "svg") == expected
    axes = am.plot.plot_presence(tracks)
    assert am.plot.figure_bytes([axes], "svg") == expected
    with pytest.raises(am.ParameterError, match="one of pdf, png, svg"):
        am.plot.figure_bytes(axes, "jpg")


def test_text_in_a_pdf_is_text():
    assert b"/FontFile2" in am.plot.figure_bytes(am.plot.plot_presence(tracks_of(["0"])), "pdf")


def test_names_are_not_mathematics():
    d = am.simulate.cube(seed=1).detections
    names = [f"$\\frac{{{k}" for k in range(8)]
    tracks = am.Tracks(detections=d, labels=np.tile(np.arange(8), d.n_frames), names=names,
                       confidence=np.ones(d.n_points))  # fmt: skip
    score = am.evaluate(tracks, tracks)
    part = am.metrics.calibration_curve([0.5], [True])
    for axes in (
        am.plot.plot_presence(tracks), am.plot.plot_confidence(tracks),
        am.plot.plot_reliability({"$\\x": part}),
        am.plot.plot_compare({"$\\frac{": score})[0],
        am.plot.plot_posterior([1], [2], others={"$\\x": 1}),
    ):  # fmt: skip
        axes.figure.savefig(io.BytesIO())


def test_no_global_state():
    script = (
        "import sys, asterism as am\n"
        "am.plot.plot_axes\n"
        "assert 'matplotlib' not in sys.modules and 'rerun' not in sys.modules\n"
        "am.plot.figure_bytes(am.plot.plot_axes(am.simulate.cube()), 'png')\n"
        "assert 'matplotlib.pyplot' not in sys.modules\n"
        "import matplotlib\n"
        "assert matplotlib.rcParams['svg.hashsalt'] is None\n"
    )
    subprocess.run([sys.executable, "-c", script], check=True, timeout=60)


def test_confidence_says_of_what_it_is():
    truth = am.simulate.cube(seed=1, frames=20)
    sure = np.full(truth.detections.n_points, 0.875)
    tracks = dataclasses.replace(truth, confidence=sure, identity_confidence=sure / 2)
    for axes, title, of in (
        (am.plot.plot_confidence(tracks), "confidence of links, mean 0.875", "a link"),
        (am.plot.plot_identity(tracks), "confidence of identities, mean 0.438", "an identity"),
    ):
        (above,) = axes.child_axes
        assert above.get_xlabel() == title
        bars = [a.get_ylabel() for a in axes.figure.axes if a is not axes]
        assert f"confidence of {of}" in bars
