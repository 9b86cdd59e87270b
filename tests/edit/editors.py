"""``asterism edit`` in processes that are forked from one that has imported everything already.

A process of its own for each test would import it and track the same capture again. The forked
process carries out the whole command, except the tracking of the known capture, whose tracks it is
given.
"""

from __future__ import annotations

import contextlib
import dataclasses
import functools
import multiprocessing
import os
import signal
import sys
import tempfile
from pathlib import Path

import asterism as am
from asterism.cli import main
from asterism.edit import session

CAPTURE = "trial.c3d"
_carry_out = session.without_edits
_captures, _results = [], []


def write_capture(folder):
    """Write a capture with uncertain decisions."""
    scene = am.simulate.person(frames=250, seed=1)
    truth = am.simulate.corrupt(
        scene, missing=0.2, missing_run=12, clutter=0.02, noise=0.003, seed=1
    )
    am.write(truth.detections, Path(folder) / CAPTURE)


def _capture():
    if not _captures:
        with tempfile.TemporaryDirectory() as folder:
            write_capture(folder)
            _captures.append(am.read(Path(folder) / CAPTURE))
    return _captures[0]


def _known(recipe, detections, *, marker_sets=None, progress=None):
    """Carry out a recipe, or return its earlier result where the capture is the known one."""
    known = _capture()
    is_known = not marker_sets and (
        detections.n_points == known.n_points
        and (detections.points == known.points).all()
        and (detections.offsets == known.offsets).all()
    )
    for earlier, result in _results if is_known else []:
        if recipe == earlier:  # in a file of its own
            tracks = dataclasses.replace(result.tracks, detections=detections)
            return dataclasses.replace(result, tracks=tracks)
    result = _carry_out(recipe, detections, marker_sets=marker_sets, progress=progress)
    if is_known:
        _results.append((recipe, result))
    return result


def recipe_of(capture, method=None):
    """Return the settings by which the command tracks a capture."""
    return am.tracking.plan_tracking(capture, method, seed=0).recipe


@functools.cache
def _track_for_commands():
    """Track the capture by the settings of the commands that the fixtures run."""
    for method in (None, am.GNN()):
        _known(recipe_of(_capture(), method), _capture())


@contextlib.contextmanager
def tracked_once():
    """Sessions of the known capture begin with tracks that are computed once in this process."""
    session.without_edits = _known
    try:
        yield
    finally:
        session.without_edits = _carry_out


def _edit(folder, options, capture, results, out, err):
    """Carry out the command in this process, with its output in two pipes."""
    _captures.append(capture)
    _results.extend(results)
    os.chdir(folder)
    for number, name, pipe in ((1, "stdout", out), (2, "stderr", err)):
        os.dup2(pipe.fileno(), number)
        pipe.close()
        setattr(sys, name, os.fdopen(number, "w", encoding="utf-8", closefd=False))
    # As a process in the foreground of a shell.
    signal.signal(signal.SIGINT, signal.default_int_handler)
    with tracked_once():
        code = main(["edit", CAPTURE, *options])
    sys.stdout.flush()
    sys.stderr.flush()
    os._exit(code)


class Forked:
    """A forked process that carries out ``asterism edit``; as `subprocess.Popen` to its user."""

    def __init__(self, folder, options):
        context = multiprocessing.get_context("forkserver")
        context.set_forkserver_preload(["tests.edit.preloaded"])
        _track_for_commands()
        ends = [context.Pipe(duplex=False) for _ in range(2)]
        writers = [writer for _, writer in ends]
        known = (_capture(), _results)
        self._process = context.Process(target=_edit, args=(str(folder), options, *known, *writers))
        self._process.start()
        for writer in writers:
            writer.close()
        self.stdout, self.stderr = (
            os.fdopen(os.dup(r.fileno()), encoding="utf-8") for r, _ in ends
        )
        for reader, _ in ends:
            reader.close()
        self.pid = self._process.pid

    @property
    def returncode(self):
        return self._process.exitcode

    def poll(self):
        return self._process.exitcode

    def communicate(self, timeout):
        """Wait for the end; return what was printed since."""
        self._process.join(timeout)
        assert self._process.exitcode is not None
        with self.stdout, self.stderr:
            return self.stdout.read(), self.stderr.read()
