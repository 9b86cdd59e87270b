"""What the command line refuses, in one line."""

from __future__ import annotations

from pathlib import Path

import pytest

import asterism as am
from asterism.cli import main
from tests.cli.runs import refused, run


def test_no_input_is_written_to(scene, capsys):
    (scene / "link.csv").symlink_to(scene / "in.csv")
    (scene / "hard.csv").hardlink_to(scene / "in.csv")
    run("track in.csv --model model.toml --run first", capsys)
    kept = {path: path.read_bytes() for path in scene.rglob("*.*") if path.is_file()}
    for line in (
        "track in.csv -o in.csv",
        "track in.csv -o link.csv",
        "track in.csv -o hard.csv",
        "track in.csv -o ./in.csv",
        "track in.csv --model model.toml -o model.toml --format csv",
        "track --from first/run.toml -o first/run.toml --format csv",
        "track --from first/run.toml --run first --overwrite",
        "estimate in.csv -o in.csv",
        "corrupt truth.csv -o truth.csv --truth t.csv",
        "corrupt truth.csv -o a.csv --truth truth.csv",
        "corrupt truth.csv -o a.csv --truth a.csv",
        "evaluate in.csv truth.csv --by-frame truth.csv",
        "evaluate in.csv truth.csv --by-frame in.csv",
    ):
        refused(line, capsys)
    assert {path: path.read_bytes() for path in kept} == kept


@pytest.mark.parametrize(
    ("line", "says"),
    [
        ("track nowhere.csv", "nowhere.csv: no such file"),
        ("track", "IN: expected a capture"),
        ("track in.csv --method gn", "Did you mean 'gnn'?"),
        (
            "track in.csv --method gnn --option gate.probabil=1e-6",
            "Did you mean 'gate.probability'?",
        ),
        ("track in.csv --method gnn --option proposers=tracks", "method gnn"),
        ("track in.csv --method gnn --option lifecycle.delete_odds", "NAME=VALUE"),
        (
            "track in.csv --method gnn --option lifecycle.delete_odds=many",
            "lifecycle.delete_odds: expected a number, found 'many'",
        ),
        (
            "track in.csv --method gnn --option lifecycle.delete_odds=0.5",
            "lifecycle.delete_odds: expected a number > 1",
        ),
        (
            "track in.csv --method mcmcda --option chains=0",
            "chains: expected a whole number in [1, 1024]",
        ),
        ("track in.csv --method smp --option proposers=track", "Did you mean 'tracks'?"),
        ("track in.csv --seed -1", "--seed"),
        ("track in.csv --format c3", "Did you mean 'c3d'?"),
        ("track in.csv -o out.log", "a name ending in .c3d, .trc, .csv, .tsv"),
        ("track in.csv -o nowhere/out.csv", "a folder that exists"),
        ("track in.csv --model nowhere.toml", "nowhere.toml"),
        ("track in.csv --model in.csv", "in.csv: the file: expected TOML"),
        ("track --from nowhere.toml", "nowhere.toml"),
        ("track --from in.csv", "expected TOML"),
        ("track in.csv --option lifecycle.delete_odds=5", "Give the method"),
        ("track in.csv --methd gnn", "Did you mean '--method'?"),
        ("trak in.csv", "Did you mean 'track'?"),
        ("corrupt in.csv -o a.csv --truth t.csv", "has no labels"),
        ("corrupt truth.csv -o a.csv --truth t.csv --missing 2", "missing: expected a number in"),
        ("corrupt truth.csv -o a.csv --truth t.csv --burst 5:60", "--burst: expected N or N:MIN"),
        ("corrupt truth.csv -o a.csv --truth t.csv --ghosts 5:9-3", "--ghosts (longest): expected"),
        ("corrupt truth.csv -o a.csv", "--truth"),
        ("evaluate in.csv nowhere.csv", "nowhere.csv"),
        ("info nowhere.csv", "nowhere.csv"),
        ("simulate cub -o a.csv", "Did you mean 'cube'?"),
        ("simulate cube -o a.csv --option sped=1", "Did you mean 'speed'?"),
        ("simulate cube -o a.csv --frames 0", "frames: expected a whole number"),
        ("demo -o in.csv", "a folder"),
    ],
)
def test_what_the_user_can_mend(scene, capsys, line, says):
    before = sorted(scene.rglob("*"))
    assert says in refused(line, capsys)
    assert sorted(scene.rglob("*")) == before


def test_damaged_run_files(scene, capsys):
    run("track in.csv --method gnn --model model.toml --run first", capsys)
    good = (scene / "first/run.toml").read_text()
    path = scene / "run.toml"
    for old, new, says in (
        ("seed = 0", "seed = -1", "method.seed"),
        ('format = "csv"', 'format = "cvs"', "Did you mean 'csv'?"),
        ('name = "gnn"', "name = 3", "method.name: expected a text"),
        ("[output]", "[outptu]", "Did you mean 'output'?"),
        ("p_detection", "p_detectoin", "Did you mean 'p_detection'?"),
        ("delete_odds = 300.0", "delete_odds = 0.1", "delete_odds"),
        ("delete_odds = 300.0", "delet_odds = 300.0", "Did you mean 'delete_odds'?"),
    ):
        assert good.count(old) == 1
        path.write_text(good.replace(old, new))
        assert says in refused("track --from run.toml -o a.csv", capsys)


def test_a_model_is_written_under_the_name_of_one(scene, capsys):
    for line in ("estimate in.csv", "markerset learn truth.csv"):
        assert main(f"{line} -o model.json".split()) == 2
        assert "--out: expected a name ending in .toml, found model.json" in capsys.readouterr().err
        assert not Path("model.json").exists()
        run(f"{line} -o model.TOML", capsys)
        Path("model.TOML").unlink()


def test_only_mcmcda_starts_from_tracks(scene, capsys, monkeypatch):
    def never(*_, **__):
        raise AssertionError

    monkeypatch.setattr("asterism.estimate_model", never)  # refused before the work
    assert main(["track", "truth.csv", "-o", "out.csv", "--method", "gnn", "--start"]) == 2
    message = capsys.readouterr().err
    assert "--start: expected --method mcmcda, or no --method, found --method gnn" in message


def test_the_common_options_are_everywhere():
    # A command without --quiet or --json stops the script that passes them to all commands alike.

    from asterism.cli.program import command as program

    commands = dict(program.commands)
    for group in ("camera", "markerset"):
        own = commands.pop(group).commands
        commands |= {f"{group} {name}": command for name, command in own.items()}
    lists = {"methods", "scenes"}
    assert lists < commands.keys()
    assert "camera map" in commands
    for name, command in commands.items():
        options = {o for parameter in command.params for o in parameter.opts}
        wanted = {"--json"} if name in lists else {"--json", "--quiet", "-q"}
        assert wanted <= options, name


@pytest.mark.parametrize(("line", "says"), [
    ("simulate person -o a.c3d --markers 3", "--markers: expected a whole number in [40, 90]"),
    ("simulate cube -o a.c3d --frames 0", "--frames: expected"),
    ("simulate cube -o a.c3d --option frames=0", "frames: expected"),
    ("corrupt scene.csv -o a.csv --truth t.csv --missing 10", "--missing: expected"),
    ("corrupt scene.csv -o a.csv --truth t.csv --corrupt missing=10", "missing: expected"),
    ("camera map rig.toml --low 1,1,1 --high 0,0,0", "--high: expected"),
    ("camera map rig.toml --suggest -1", "--suggest: expected"),
    ("camera info rig.toml --from opncv", "--from: expected"),
    ("camera convert rig.toml rig.abc", "OUT: expected a name ending in"),
    ("camera convert rig.toml a.yml --format opncv", "--format: expected one of"),
    ("track in.csv --method gn", "--method: expected one of"),
    ("track in.csv --run .", "--run: expected a new or an empty folder"),
    ("track in.csv --report page.pdf", "--report: expected a name ending in .html"),
    ("report truth.csv -o page.pdf", "--out: expected a name ending in .html"),
    ("film cube --rig ring4 -o .", "--out: expected a new or an empty folder"),
    ("evaluate truth.csv in.csv", "The truth is the second of the two files."),
    ("info empty.csv", "found an empty file"),
    ("reconstruct in.csv --rig rig.toml -o a.csv", "line 1: expected the columns"),
])  # fmt: skip
def test_mistakes_are_told_by_the_names_of_the_command_line(scene, capsys, line, says):
    am.io.write_rig(am.Rig.ring(4, radius=4, height=2.5), "rig.toml")
    Path("empty.csv").touch()
    before = sorted(scene.iterdir())
    message = refused(line, capsys)
    assert f" {says}" in message  # an option has its dashes, an argument of the library has none
    assert message.count("\n") == 1
    assert sorted(scene.iterdir()) == before


def test_noise_in_millimetres_is_doubted(scene, capsys):
    for noise, warns in (("0.0003", False), ("3", True)):
        assert (
            main(f"corrupt scene.csv -o a.csv --truth t.csv --noise {noise} -q --overwrite".split())
            == 0
        )
        assert ("the markers span only" in capsys.readouterr().err) == warns
