"""Run a line of the command line that must succeed, or be refused in one line."""

from __future__ import annotations

import shlex

from asterism.cli import main


def run(line, capsys):
    """Run a command that must succeed; return what it printed."""
    return printed(line, capsys)[0]


def printed(line, capsys):
    """Run a command that must succeed; return what it printed and what it reported."""
    capsys.readouterr()
    code = main(shlex.split(line))
    out, err = capsys.readouterr()
    assert code == 0, err
    return out, err


def refused(line, capsys):
    """Run a command that the user can mend; return the message."""
    capsys.readouterr()
    code = main(shlex.split(line))
    out, err = capsys.readouterr()
    assert code == 2, err
    assert out == ""
    assert "Traceback" not in err
    return err
