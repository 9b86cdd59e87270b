"""Report pages that the command line writes."""

from __future__ import annotations

from asterism.cli import main
from tests.reporting.cases import text_of


def test_commands_write_pages(tmp_path, monkeypatch, capsys):
    monkeypatch.chdir(tmp_path)
    made = "simulate crossing -o in.csv --truth truth.csv -q "
    made += "--corrupt missing=0.05 --corrupt clutter=0.05"
    assert main(made.split()) == 0
    assert (
        main(["track", "in.csv", "-o", "out.csv", "--method", "jpda", "--report", "first.html"])
        == 0
    )
    printed = capsys.readouterr().out
    first = text_of((tmp_path / "first.html").read_bytes())
    for word in ("jpda", "log posterior", "frames/s", "model: "):
        assert word in first
    assert "first.html" in printed
    assert main(["report", "out.csv", "--truth", "truth.csv", "--title", "Mine", "--json"]) == 0
    assert '"output": "out.html"' in capsys.readouterr().out
    assert "Comparison with the truth" in text_of((tmp_path / "out.html").read_bytes())
    for line in (
        "report out.csv -o out.csv",
        "report out.csv --truth in.html",
        "track in.csv -o a.csv --report a.csv",
    ):
        assert main(line.split()) == 2
        assert "Traceback" not in capsys.readouterr().err
    assert not (tmp_path / "a.csv").exists()
