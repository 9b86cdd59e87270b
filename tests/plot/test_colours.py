"""Colours and legends of trajectories and axes, with few and with many tracks."""

from __future__ import annotations

import numpy as np
import pytest
from matplotlib.colors import to_hex
from mpl_toolkits.mplot3d.art3d import Line3DCollection

import asterism as am
from asterism.plot.style import CLUTTER


def person(n_markers):
    truth = am.simulate.person(seed=1).part(0, 20)
    return truth.select(range(n_markers))


def legend_of(axes):
    (legend,) = axes.figure.legends
    return [text.get_text() for text in legend.get_texts()]


def test_few_tracks_are_named_in_a_legend():
    few = person(7)
    assert legend_of(am.plot.plot_trajectories(few)) == list(few.names)
    assert legend_of(am.plot.plot_axes(few)[0]) == list(few.names)


def test_many_tracks_are_coloured_by_time():
    many = person(30)
    axes = am.plot.plot_trajectories(many)
    assert not axes.figure.legends
    (lines,) = (c for c in axes.collections if isinstance(c, Line3DCollection))
    times = many.detections.times
    assert len(lines.get_array()) == 30 * 19
    assert (lines.get_array().min(), lines.get_array().max()) == (times[0], times[-2])
    (bar,) = (other for other in axes.figure.axes if other is not axes)
    assert bar.get_ylabel() == "time [s]"


def test_a_gap_is_not_joined_by_a_line_in_colours_of_time():
    positions = np.cumsum(np.ones((5, 9, 3)), axis=0)
    positions[2, 0] = np.nan
    axes = am.plot.plot_trajectories(am.Tracks.from_dense(np.arange(5), positions))
    (lines,) = (c for c in axes.collections if isinstance(c, Line3DCollection))
    assert len(lines.get_array()) == 8 * 4 + 2


@pytest.mark.parametrize("plot", [am.plot.plot_trajectories, am.plot.plot_axes])
def test_a_segment_has_one_colour_and_one_entry(plot):
    tracks = person(9)
    segments = [0, 0, 0, 0, 1, 1, -1, 1, -1]
    drawn = plot(tracks, segments=segments)
    axes = drawn[0] if isinstance(drawn, list) else drawn
    colours = [to_hex(line.get_color()) for line in axes.lines if line.get_linestyle() == "-"]
    assert len(colours) == 9
    assert {colours[k] for k in (6, 8)} == {CLUTTER.lower()}
    assert len({colours[k] for k in range(4)}) == len({colours[k] for k in (4, 5, 7)}) == 1
    assert len(set(colours)) == 3
    a, b, c, *_ = names = tracks.names
    assert legend_of(axes) == [f"{a}, {b}, {c} …", ", ".join([*names[4:6], names[7]]), "no segment"]


def test_the_prefix_of_a_subject_stands_once_in_an_entry():
    one = am.Tracks.from_dense([0, 1], np.zeros((2, 3, 3)), ["Anna:LKNE", "Anna:RKNE", "Ben:LKNE"])
    axes = am.plot.plot_trajectories(one, segments=[0, 0, 0])
    assert legend_of(axes) == ["Anna:LKNE, RKNE, Ben:LKNE"]


def test_more_segments_than_colours_have_no_legend():
    tracks = person(40)
    axes = am.plot.plot_axes(tracks, segments=np.arange(40))[0]
    assert not axes.figure.legends


@pytest.mark.parametrize("segments", [[0, 1], [0.5, 1, 2], "abc"])
def test_segments_must_fit_the_tracks(segments):
    with pytest.raises(am.ParameterError, match="3 integers, one for each track"):
        am.plot.plot_axes(person(3), segments=segments)
