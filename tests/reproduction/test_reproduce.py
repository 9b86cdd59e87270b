"""The 2010 report reproduced: the files, that they are the same twice, and what is refused."""

from __future__ import annotations

import json
import re
import signal
import subprocess
import sys
import time

import numpy as np
import pytest

from asterism.cli import main
from asterism.reproduction import PARTS, load
from asterism.reproduction.marriage import MEN, UNSTABLE, WOMEN, blocking_pairs, marry, worst
from asterism.reproduction.rules import alike, exact, fewer, spread, within
from asterism.reproduction.scores import compare, cubes, own_chain, score_table

LINE = ("--seeds", "2", "--only", "preferences", "--only", "splitting")


def files_of(folder):
    return {
        str(path.relative_to(folder)): path.read_bytes()
        for path in sorted(folder.rglob("*"))
        if path.is_file()
    }


@pytest.fixture(scope="module")
def made(tmp_path_factory):
    out = tmp_path_factory.mktemp("made") / "out"
    assert main(["reproduce", *LINE, "-o", str(out), "-q"]) == 0
    return out


def test_the_page_has_report_measurement_and_verdict_for_every_claim(made):
    text = (made / "reproduction.md").read_text(encoding="utf-8")
    # The order is that of the report, whatever the order of --only.
    assert text.index("## Track splitting") < text.index("## The stable marriage")
    row = next(line for line in text.splitlines() if "up to frame 100" in line)
    about, reported, measured, oracle, verdict = (
        cell.strip() for cell in row.strip("|").split("|")
    )
    assert (about, reported, oracle) == ("true tracks rejected, up to frame 100", "1 %", "–")
    # α holds in each frame, so many more are lost in a hundred: known, about 8.4 %.
    assert 7 < float(measured.split()[0]) < 10
    assert verdict.startswith("**not reproduced**, because 1 lies below ")
    assert "**reproduced**, because the number that do not is 0" in text
    assert "seed by seed" in text  # the rules are stated
    assert "Stopped" not in text
    # Times are what differs from run to run.
    assert "seconds" not in text


def test_files_of_a_part(made):
    found = files_of(made)
    assert set(found) == {
        "images/report_preferences.svg", "parts/contents.md", "parts/preferences.md",
        "parts/rules.md", "parts/splitting.md", "reproduction.md", "times.md",
    }  # fmt: skip
    assert b"<svg" in found["images/report_preferences.svg"]
    for name in ("contents", "preferences", "rules", "splitting"):
        assert found[f"parts/{name}.md"].strip() in found["reproduction.md"]
    links = re.findall(rb"\]\((images/[^)]+)\)", found["reproduction.md"])
    assert [link.decode() for link in links] == ["images/report_preferences.svg"]


def test_the_same_seeds_give_the_same_bytes(made, tmp_path):
    # In another process: nothing may come from the order of sets or from what ran before.
    subprocess.run(
        [sys.executable, "-m", "asterism.cli", "reproduce", *LINE, "-o", "again", "-q"],
        cwd=tmp_path, check=True, timeout=120,
    )  # fmt: skip
    first, second = files_of(made), files_of(tmp_path / "again")
    assert set(first) == set(second)
    assert [name for name in first if first[name] != second[name]] == []


def test_verdicts_as_json(tmp_path, capsys):
    out = tmp_path / "out"
    line = ["reproduce", "--seeds", "2", "--only", "gates", "-o", str(out), "--json"]
    assert main(line) == 0
    found = json.loads(capsys.readouterr().out)
    assert [claim["reproduced"] for claim in found["parts"]["gates"]] == [True] * 3
    assert set(found["parts"]["gates"][0]) == {
        "about", "reported", "measured", "oracle", "reproduced", "rule", "because",
    }  # fmt: skip


@pytest.mark.parametrize(
    ("arguments", "said"),
    [
        (["--only", "marriages"], "Did you mean 'marriage'?"),
        (["--only", ""], "--only"),
        (["--seeds", "1"], "--seeds"),
        (["--seeds", "1001"], "--seeds"),
    ],
)
def test_what_is_refused(arguments, said, tmp_path, capsys):
    out = tmp_path / "out"
    assert main(["reproduce", "-o", str(out), *arguments]) == 2
    error = capsys.readouterr().err
    assert said in error
    assert "Traceback" not in error
    assert not out.exists()


def test_a_folder_that_holds_files_is_left_alone(tmp_path, capsys):
    (tmp_path / "mine.txt").write_text("mine")
    line = ["reproduce", "--seeds", "2", "--only", "gates", "-o", str(tmp_path), "-q"]
    assert main(line) == 2
    assert "--overwrite" in capsys.readouterr().err
    assert [path.name for path in tmp_path.iterdir()] == ["mine.txt"]
    assert main([*line, "--overwrite"]) == 0
    assert (tmp_path / "mine.txt").read_text() == "mine"
    assert (tmp_path / "reproduction.md").exists()


def test_what_is_finished_is_written_when_it_is_stopped(tmp_path):
    # The first part draws nothing at random, the second would take a minute.
    line = ["--only", "moves", "--only", "mcmcda", "--seeds", "30", "-o", "out"]
    process = subprocess.Popen(
        [sys.executable, "-m", "asterism.cli", "reproduce", *line],
        cwd=tmp_path, stderr=subprocess.PIPE, stdout=subprocess.DEVNULL, text=True,
        preexec_fn=lambda: signal.signal(signal.SIGINT, signal.default_int_handler),
    )  # fmt: skip
    end = time.monotonic() + 60
    while not (tmp_path / "out" / "parts" / "moves.md").exists():
        assert process.poll() is None, process.stderr.read()
        assert time.monotonic() < end
        time.sleep(0.01)
    process.send_signal(signal.SIGINT)
    _, error = process.communicate(timeout=60)
    assert process.returncode == 130
    assert "not made: mcmcda" in error
    assert "Traceback" not in error
    text = (tmp_path / "out" / "reproduction.md").read_text(encoding="utf-8")
    assert "Stopped before its end. Not made: mcmcda." in text
    assert "## MCMCDA: the moves" in text
    assert not list((tmp_path / "out").rglob("*.part"))


def test_every_part_says_what_it_covers():
    covered = ""
    for name in PARTS:
        part = load(name)
        assert part.name == name
        assert part.title
        assert part.summary.endswith(".")
        assert part.section.startswith("§")
        covered += f"{part.covers}; "
    # All of the report's figures but the flow diagram, its tables and its algorithms.
    for figure in ("2.1", "3.1", "3.2", "3.3", "3.4", "3.5", "3.6", "3.7", "4.1", "4.2", "4.3",
                   "5.1", "5.2", "5.3", "5.4", "5.5", "table of §4.3", "table of §5.6",
                   "algorithm 1", "algorithm 2", "algorithm 3", "equation 4.7"):  # fmt: skip
        assert figure in covered


class TestRules:
    """Each rule says yes and no where it is plain which."""

    def test_within(self):
        values = np.linspace(10, 12, 101)
        claim = within("tracks", 11, values, step=1, sign="~", unit=" %", digits=1, oracle=[8, 8])
        assert claim[:5] == ("tracks", "~11 %", "11.0 ± 0.6 %", "8.0 ± 0.0 %", True)
        # 12 as printed may have been 12.4, and 11.95 was measured.
        assert within("", 12.4, values, step=1).reproduced
        below = within("", 9, values, step=1)
        assert not below.reproduced
        assert below.because == "9 lies below 10.05 to 11.95"
        assert "above" in within("", 13, values, step=1).because
        # Half a unit of the last digit printed, and no more.
        assert within("", 8, np.full(5, 8.5), step=1).reproduced
        assert not within("", 8, np.full(5, 8.51), step=1).reproduced

    def test_exact(self):
        assert exact("", "", 0, "number", 5).reproduced
        assert not exact("", "", 1, "number", 5).reproduced
        assert exact("", "", 1e-13, "error", 5, 1e-12).reproduced
        assert not exact("", "", float("nan"), "error", 5, 1e-12).reproduced

    def test_fewer(self):
        noise = np.array([0.1, -0.1, 0.2, -0.2])
        claim = fewer("", "", 1 + noise, 2 - noise, "tracks", 1)
        assert claim.reproduced
        assert claim.measured == "1.0 ± 0.2 instead of 2.0 ± 0.2 tracks"
        assert claim.because == "the mean difference is −1.0 (standard error 0.2)"
        assert not fewer("", "", 2 + noise, 1 - noise, "tracks").reproduced
        assert not fewer("", "", 1 + noise, 1 - noise, "tracks").reproduced
        assert not fewer("", "", [1, 1], [1, 1], "tracks").reproduced  # no change is no gain

    def test_alike(self):
        runs = np.array([[0.8, 0.2], [0.9, 0.1], [0.7, 0.3], [0.8, 0.2]])
        claim = alike("", [0.82, 0.18], runs)
        assert claim.reproduced
        assert (claim.reported, claim.measured) == ("82, 18 %", "80.0, 20.0 %")
        assert not alike("", [0.5, 0.5], runs).reproduced

    def test_spread(self):
        assert spread([1, 2, 3], 1) == "2.0 ± 0.8"
        assert spread([-0.001, 0.0]) == "0.00 ± 0.00"


def test_the_worst_lists_take_as_many_proposals_as_any():
    for n in (2, 3, 7, 30):
        assert marry(*worst(n))[1] == n * n - n + 1


def test_the_test_of_a_stable_matching_finds_the_blocking_pairs_of_figure_5_1():
    assert blocking_pairs(marry(MEN, WOMEN)[0], MEN, WOMEN) == []
    # By hand: A-b, B-a, C-c. The blocking pairs are A and a, B and b, and C and a.
    assert blocking_pairs(UNSTABLE, MEN, WOMEN) == [(0, 0), (1, 1), (2, 0)]


def test_scores_of_the_undisturbed_cube():
    found = compare(cubes(1, max_gap=2, missing=0, clutter=0), {"own": own_chain(moves=10)})
    oracle, own = found["oracle"], found["own"]
    assert (oracle.moves, oracle.gain, own.gain) == (0, 0, pytest.approx(0, abs=1e-6))
    for scores in (oracle, own):
        assert (scores.tracks, scores.correct, scores.strict, scores.wrong) == (8, 100, 0, 0)
    rows = score_table("", found).rows
    assert rows[0] == ["oracle", "0", "0.00 ± 0.00", "0.00 ± 0.00", "8.0 ± 0.0", "0.00 ± 0.00",
                       "1.000 ± 0.000", "0.0"]  # fmt: skip
