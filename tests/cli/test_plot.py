"""The command that draws: every kind, and what it refuses."""

from __future__ import annotations

import json
import shutil

import numpy as np
import pytest

import asterism as am
from asterism.cli import main
from asterism.cli.plot_kinds import KINDS
from tests.cli.runs import refused, run

# Of each kind what follows its name, in the folder below.
LINES = {
    "trajectories": "run",
    "axes": "run/in.tracked.csv",
    "presence": "truth.csv",
    "confidence": "run",
    "identity": "run",
    "errors": "run --truth truth.csv",
    "reliability": "run run/in.tracked.csv --truth truth.csv",
    "compare": "run truth.csv --truth truth.csv",
    "projections": "truth.csv --rig ring3",
    "image": "truth.csv --rig ring3 --frame 5",
    "posterior": "in.csv --model model.toml --moves 1 --moves 4 --seeds 2",
    "groups": "run --model model.toml",
    "rig": "rig.toml",
    "lens": "rig.toml --camera cam2",
}


@pytest.fixture(scope="module")
def made(tmp_path_factory):
    """A folder with a capture, its truth, a model, a finished run of mcmcda, and cameras."""
    folder = tmp_path_factory.mktemp("made")
    scene = am.simulate.crossing(frames=20, rate=50, seed=3)
    truth = am.simulate.corrupt(scene, missing=0.1, clutter=0.1, noise=0.003, seed=1)
    am.write(truth, folder / "truth.csv")
    unlabelled = np.full(truth.detections.n_points, -1)
    am.write(am.Tracks(detections=truth.detections, labels=unlabelled), folder / "in.csv")
    am.estimate_model(truth.detections).model.to_toml(folder / "model.toml")
    rig = am.Rig.ring(3, radius=4, height=2, target=(0, 0, 0))
    am.io.write_rig(rig, folder / "rig.toml")
    film = am.simulate.film(scene, rig)
    am.io.write_observations(film.observations, folder / "film.csv")
    line = f"{folder}/in.csv --model {folder}/model.toml --method mcmcda --run {folder}/run -q"
    assert main(["track", *line.split()]) == 0
    return folder


@pytest.fixture
def work(made, tmp_path, monkeypatch):
    shutil.copytree(made, tmp_path, dirs_exist_ok=True)
    monkeypatch.chdir(tmp_path)
    return tmp_path


def test_every_kind_is_tried():
    assert set(LINES) == set(KINDS)


@pytest.mark.parametrize("kind", LINES)
def test_each_kind_is_drawn_the_same_twice(work, capsys, kind):
    assert run(f"plot {kind} {LINES[kind]} -o a.svg", capsys) == "written  a.svg\n"
    first = (work / "a.svg").read_bytes()
    assert first.startswith(b"<?xml")
    assert run(f"plot {kind} {LINES[kind]} -o a.svg --overwrite -q", capsys) == ""
    assert (work / "a.svg").read_bytes() == first


@pytest.mark.parametrize("ending", ["pdf", "png", "svg"])
def test_the_ending_decides(work, capsys, ending):
    run(f"plot presence truth.csv -o a.{ending}", capsys)
    start = {"pdf": b"%PDF", "png": b"\x89PNG", "svg": b"<?xml"}[ending]
    assert (work / f"a.{ending}").read_bytes().startswith(start)
    assert not list(work.glob(".*"))


def test_the_picture_lies_beside_what_it_shows(work, capsys):
    run("plot presence truth.csv", capsys)
    assert (work / "truth.presence.pdf").is_file()
    made = json.loads(run("plot presence run --json", capsys))
    assert made["kind"] == "presence"
    assert (work / "run.presence.pdf").is_file()


def test_compare_takes_the_time_from_the_run(work, capsys, monkeypatch):
    taken = {}
    before = am.plot.plot_compare

    def plot_compare(scores, milliseconds):
        taken.update(scores=scores, milliseconds=milliseconds)
        return before(scores, milliseconds=milliseconds)

    monkeypatch.setattr(am.plot, "plot_compare", plot_compare)
    run("plot compare run truth.csv --truth truth.csv -o a.png", capsys)
    summary = json.loads((work / "run/summary.json").read_text())
    assert taken["milliseconds"] == {"run": pytest.approx(1e3 / summary["frames_per_second"])}
    assert taken["scores"]["truth"].idf1 == 1


def test_errors_are_those_of_the_file(work, capsys, monkeypatch):
    """The truth is found detection by detection, though a file has an order of its own."""
    seen = []
    before = am.plot.plot_errors
    monkeypatch.setattr(am.plot, "plot_errors", lambda *a: seen.append(before(*a)) or seen[-1])
    run("plot errors truth.csv --truth truth.csv -o a.png", capsys)
    (above,) = seen[0].child_axes
    assert above.get_xlabel() == "0 % of the labels wrong"


def test_observations_of_a_film_are_drawn_as_they_are(work, capsys, monkeypatch):
    seen = []
    before = am.plot.plot_projections
    monkeypatch.setattr(am.plot, "plot_projections", lambda *a: seen.extend(a) or before(*a))
    run("plot projections film.csv --rig rig.toml -o a.png", capsys)
    np.testing.assert_array_equal(seen[0].pixels, am.io.read_observations("film.csv").pixels)
    line = "projections film.csv --rig no.toml -o a.png"
    assert "no.toml: no such file" in refused("plot " + line.replace("a.png", "b.png"), capsys)


def test_help_lists_every_kind(capsys, monkeypatch):
    monkeypatch.setenv("COLUMNS", "120")
    text = run("plot --help", capsys)
    for name, kind in KINDS.items():
        assert f"{name}  {kind.about[:40]}" in text
    assert "[bold" not in text
    assert "KINDS" not in text


@pytest.mark.parametrize(
    ("line", "message"),
    [
        ("presenc truth.csv", "Did you mean 'presence'?"),
        ("errors run", "--truth: expected a file, which errors needs, found nothing"),
        ("projections truth.csv", "--rig: expected"),
        ("confidence truth.csv", "tracks with a confidence"),
        ("identity truth.csv", "tracks with a confidence"),
        ("reliability run truth.csv --truth truth.csv", "truth.csv, which has none"),
        ("presence truth.csv --truth truth.csv", "uses it: errors, reliability, compare"),
        ("presence truth.csv in.csv", "one file for presence"),
        ("presence truth.csv -o a.jpg", "a name ending in .pdf, .svg or .png"),
        ("presence truth.csv -o a", "a name ending in .pdf, .svg or .png"),
        ("presence truth.csv -o no/a.pdf", "in a folder that exists"),
        ("errors run --truth truth.csv -o truth.csv", "--out: expected"),
        ("presence nothing.csv", "nothing.csv"),
        ("presence .", "summary.json: expected a finished run"),
        ("errors run --truth rig.toml", "rig.toml"),
        ("image in.csv --rig ring3", "points in tracks"),
        ("image truth.csv --rig ring3 --frame 99", "--frame: expected 1 to 20, found 99"),
        ("lens rig.toml --camera cam9", "one of cam1, cam2, cam3"),
        ("posterior in.csv --moves -1", "--moves"),
        ("posterior in.csv --seeds 0", "--seeds"),
        ("compare run run --truth truth.csv", "different files"),
        ("groups run --model rig.toml", "rig.toml"),
    ],
)
def test_what_plot_refuses(work, capsys, line, message):
    before = {path: path.read_bytes() for path in work.rglob("*") if path.is_file()}
    err = refused(f"plot {line}", capsys)
    assert message in err
    assert err.strip().count("\n") == 0
    assert {p: p.read_bytes() for p in work.rglob("*") if p.is_file()} == before


def test_a_folder_that_is_no_run(work, capsys):
    (work / "run/summary.json").write_text("{}")
    assert "expected a finished run, found no field output" in refused("plot presence run", capsys)


def test_an_input_is_not_overwritten(work, capsys):
    (work / "truth.csv").rename(work / "truth.pdf")
    shutil.copy(work / "run/in.tracked.csv", work / "a.csv")
    err = refused("plot errors a.csv --truth truth.pdf -o truth.pdf", capsys)
    assert "the input truth.pdf" in err


def test_markers_and_times_can_be_chosen(work, capsys):
    scene = am.io.read_tracks("truth.csv")
    asked = {
        "--markers 3,M00 --time 0 0.2": ([3, 0], 11),
        "--markers M1*": (range(10, 16), 20),
    }
    for line, (there, end) in asked.items():
        run(f"plot presence truth.csv -o part.svg {line} --overwrite", capsys)
        chosen = scene.select(there).part(0, end)
        assert (work / "part.svg").read_bytes() == am.plot.figure_bytes(
            am.plot.plot_presence(chosen), "svg"
        )


def test_size_and_resolution_can_be_chosen(work, capsys):
    run("plot axes truth.csv -o small.png --size 4 3 --dpi 100", capsys)
    assert (work / "small.png").read_bytes()[16:24] == (400).to_bytes(4, "big") + (300).to_bytes(
        4, "big"
    )


def test_many_tracks_are_coloured_by_segment(work, capsys):
    truth = am.simulate.person(seed=1).part(0, 60)
    am.write(truth, "person.csv")
    read = am.io.read_tracks("person.csv")
    run("plot axes person.csv -o axes.svg", capsys)
    segments = am.tracking.learn_bonds(read).segments(read.names)
    expected = am.plot.figure_bytes(am.plot.plot_axes(read, segments=segments), "svg")
    assert (work / "axes.svg").read_bytes() == expected
    run("plot trajectories person.csv -o time.png --by-time", capsys)
    expected = am.plot.figure_bytes(am.plot.plot_trajectories(read), "png")
    assert (work / "time.png").read_bytes() == expected
