"""The engine's rooms: includes run downwards only."""

from __future__ import annotations

import re

from tests.paths import ROOT

ENGINE = ROOT / "engine"
ROOMS = (
    "math", "base", "filter", "solve", "rigid", "tracks", "frame", "large", "trees", "mht",
    "mcmc/model", "mcmc/moves", "mcmc/chain", "mcmc/tracker", "confidence", "stitch", "naming",
    "camera", "multiview",
    "python",
)  # fmt: skip
"""From the ground up; a file includes files of its own room and of rooms before it."""
APART = {"camera": ("math",), "multiview": ("math", "base", "solve", "camera")}
"""Rooms that know nothing of tracking, and what they may include."""


def _includes():
    for path in sorted(ENGINE.rglob("*.[ch]pp")):
        name = path.relative_to(ENGINE).as_posix()
        for target in re.findall(r'#include "([^"]+)"', path.read_text(encoding="utf-8")):
            yield name, target


def _room(name: str) -> str:
    return name.rpartition("/")[0]


def test_every_file_stands_in_a_room_and_every_include_is_there():
    rooms = {_room(p.relative_to(ENGINE).as_posix()) for p in ENGINE.rglob("*.[ch]pp")}
    assert rooms == set(ROOMS)
    assert [pair for pair in _includes() if not (ENGINE / pair[1]).is_file()] == []


def test_includes_run_downwards():
    up = [pair for pair in _includes() if ROOMS.index(_room(pair[1])) > ROOMS.index(_room(pair[0]))]
    # The counters of a frame hold those of the chain, which is their own room's concern.
    assert up == []
    for room, below in APART.items():
        allowed = {room, *below}
        assert [p for p in _includes() if _room(p[0]) == room and _room(p[1]) not in allowed] == []


def test_files_do_not_include_each_other_in_circles():
    below: dict[str, set[str]] = {}
    for name, target in _includes():
        below.setdefault(name, set()).add(target)
    done: set[str] = set()

    def visit(name: str, path: tuple[str, ...]) -> None:
        assert name not in path, " → ".join((*path[path.index(name) :], name))
        if name not in done:
            for target in below.get(name, ()):
                visit(target, (*path, name))
            done.add(name)

    for name in below:
        visit(name, ())
