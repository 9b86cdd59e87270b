"""Kill sessions of the editor at random moments, and read what is on the disk.

Each session is a process of its own that carries out edits, undo and redo as the server does, and
reports each one that is confirmed. It is killed by SIGKILL. Then the file must be readable, and
hold the state after the last confirmed step, or after the step that was under way.

    python -m tests.tools.kill_sessions --count 1000
"""

# ruff: noqa: T201
from __future__ import annotations

import argparse
import asyncio
import json
import os
import select
import signal
import tempfile
import time
from pathlib import Path

import numpy as np

import asterism as am
from asterism.edit.hub import Hub
from asterism.edit.session import Session
from asterism.errors import AsterismError
from asterism.io import read_edits

MAX_SECONDS = 0.25
"""Longest time until a session is killed."""


def begun(folder: Path) -> Session:
    """Track a small capture, once for all sessions."""
    truth = am.simulate.corrupt(
        am.simulate.cube(frames=80, seed=1), missing=0.1, clutter=0.1, noise=0.001, seed=1
    )
    return Session.open(truth.detections, folder / "first.edits.toml")


def kill_one(session: Session, path: Path, seed: int) -> int:
    """Run a session and kill it; return the number of its confirmed steps."""
    rng = np.random.default_rng(seed)
    path.unlink(missing_ok=True)
    reader, writer = os.pipe()
    child = os.fork()
    if child == 0:
        os.close(reader)
        try:
            asyncio.run(_run(session, path, seed, writer))
        finally:
            os._exit(1)
    os.close(writer)
    select.select([reader], [], [])  # it has begun
    time.sleep(float(rng.uniform(0, MAX_SECONDS)))
    os.kill(child, signal.SIGKILL)
    os.waitpid(child, 0)
    with os.fdopen(reader, "rb") as pipe:
        lines = pipe.read().split(b"\n")
    steps = [json.loads(line) for line in lines[:-1]]  # the last one may be cut off
    confirmed = [step["edits"] for step in steps if step["is_confirmed"]]
    allowed = [confirmed[-1] if confirmed else []]
    if steps and not steps[-1]["is_confirmed"]:
        allowed.append(steps[-1]["edits"])
    found: list[object] = []
    if path.exists():
        found = [[each.kind, *each.at] for each in read_edits(path, session.tracks.detections)]
    found = json.loads(json.dumps(found))
    if found not in allowed:
        raise AssertionError(f"session {seed}: {found} on disk, expected one of {allowed}")
    return len(confirmed)


async def _run(session: Session, path: Path, seed: int, writer: int) -> None:
    """Carry out steps until the process is killed; write each before and after."""
    own = Session(session.begun, path)
    hub = Hub(own, path.with_suffix(".c3d"))
    rng = np.random.default_rng([seed, 1])
    n, undone = own.tracks.detections.n_points, []

    def tell(edits: object, *, is_confirmed: bool) -> None:
        line = json.dumps({"is_confirmed": is_confirmed, "edits": edits}) + "\n"
        os.write(writer, line.encode())

    def stated() -> list[object]:
        return [[each.kind, *each.at] for each in own.edits]

    while True:
        action = str(rng.choice(["edit", "edit", "edit", "undo", "redo"]))
        message = {}
        before, after = stated(), None
        if action == "edit":
            kind = str(rng.choice(["same", "different", "clutter"]))
            at = [int(i) for i in rng.choice(n, 1 if kind == "clutter" else 2, replace=False)]
            message = {"kind": kind, "detections": at, "name": ""}
            try:
                edit = own.edit(kind, *at)
            except AsterismError:
                continue
            after = [*before, [edit.kind, *edit.at]]
        elif action == "undo" and before:
            after = before[:-1]
        elif action == "redo" and undone:
            after = [*before, undone[-1]]
        if after is None:
            continue
        tell(after, is_confirmed=False)
        try:
            await hub.act(action, message)
        except AsterismError:
            tell(before, is_confirmed=True)
            continue
        tell(stated(), is_confirmed=True)
        undone = {"edit": [], "undo": [*undone, *before[-1:]], "redo": undone[:-1]}[action]


def main() -> None:
    """Kill as many sessions as asked for."""
    parser = argparse.ArgumentParser(description=__doc__.split("\n")[0])
    parser.add_argument("--count", type=int, default=1000)
    count = parser.parse_args().count
    with tempfile.TemporaryDirectory() as folder:
        session = begun(Path(folder))
        steps = [kill_one(session, Path(folder) / "trial.edits.toml", i) for i in range(count)]
    print(f"{count} sessions killed after {sum(steps)} confirmed steps: none lost, all readable")


if __name__ == "__main__":
    main()
