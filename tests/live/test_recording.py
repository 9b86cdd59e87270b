"""Recording of a C3D: what a kill, a crash and a full disk leave behind."""

from __future__ import annotations

import os
import random
import signal
import subprocess
import sys
import time

import numpy as np
import pytest

import asterism as am
from asterism.errors import FormatError, SinkError
from asterism.live import LiveFrame, StreamHeader, recover
from asterism.live.sinks.journal import read_journal
from asterism.live.sinks.recording import RecordingSink, journal_of
from tests.paths import ROOT

HEADER = StreamHeader(source="test", rate=100.0, names=("A", "B"))


def live_frame(t, names=("A", None, None), labels=(4, 9, -1), time=None):
    points = np.array([[t, 0.0, 1.0], [t, 1.0, 1.0], [t, 2.0, 1.0]])[: len(labels)]
    seconds = t / 100 if time is None else time
    return LiveFrame(
        number=t, time=seconds, points=points, labels=np.array(labels, dtype=np.int64), names=names
    )


def test_a_recording_is_the_stream(tmp_path):
    path = tmp_path / "out.c3d"
    sink = RecordingSink(path)
    sink.open(HEADER)
    for t in (1, 2, 3, 6, 7):  # two frames were lost
        sink.send(live_frame(t))
    assert journal_of(path).exists()
    assert not path.exists()
    sink.close()
    sink.close()
    assert not journal_of(path).exists()
    tracks = am.io.read_tracks(path)
    d = tracks.detections
    assert (d.n_frames, d.counts.tolist(), d.rate) == (7, [3, 3, 3, 0, 0, 3, 3], 100.0)
    assert tracks["A"][:, 0].tolist()[:3] == [1, 2, 3]
    assert "B" in tracks.names  # a marker that was never seen keeps its channel
    assert (tracks.labels < 0).sum() == 5


def test_a_name_that_comes_later_and_one_that_is_used_twice(tmp_path):
    path = tmp_path / "out.c3d"
    sink = RecordingSink(path)
    sink.open(StreamHeader(source="test"))
    sink.send(live_frame(1, (None, None, None)))
    sink.send(live_frame(2, ("A", "C", None)))
    # The track of A was lost and found again as another; then both have the name.
    sink.send(live_frame(3, ("A", "C", None), (5, 9, -1)))
    sink.send(live_frame(4, ("A", "A", None), (4, 5, -1)))
    sink.close()
    tracks = am.io.read_tracks(path)
    assert np.isfinite(tracks["A"][:, 0]).all()
    assert np.isfinite(tracks["C"][:, 0]).tolist() == [True, True, True, False]
    assert tracks.detections.counts.tolist() == [3, 3, 3, 3]


def test_clocks_that_jump(tmp_path):
    path = tmp_path / "out.c3d"
    sink = RecordingSink(path)
    sink.open(HEADER)
    for seconds in (5.0, 5.01, 3600.0, 3600.01, 0.0, 0.01):
        sink.send(live_frame(1, time=seconds))
    sink.close()
    d = am.read(path)
    seen = np.flatnonzero(d.counts).tolist()
    assert seen == [0, 1, 1001, 1002, 1003, 1004]  # a pause counts for ten seconds at most


def test_a_recording_without_frames(tmp_path):
    sink = RecordingSink(tmp_path / "out.c3d")
    sink.open(HEADER)
    sink.close()
    assert am.read(tmp_path / "out.c3d").n_frames == 0


RECORD = """
import sys, time, numpy as np
from pathlib import Path
from asterism.live import LiveFrame, StreamHeader
from asterism.live.sinks.recording import RecordingSink
sink = RecordingSink(Path(sys.argv[1]))
sink.open(StreamHeader(source="x", rate=1000.0, names=("A", "B")))
rng = np.random.default_rng(1)
for t in range(10**9):
    points = np.full((60, 3), float(t))
    sink.send(LiveFrame(number=t, time=t / 1000, points=points, labels=np.arange(60),
                        names=("A", "B", *[None] * 58)))
    print(t, flush=True)
"""


@pytest.mark.skipif(sys.platform == "win32", reason="needs SIGKILL")
@pytest.mark.parametrize("seed", range(3))
def test_a_killed_recording_loses_nothing_that_was_sent(tmp_path, seed):
    path = tmp_path / "out.c3d"
    process = subprocess.Popen(
        [sys.executable, "-c", RECORD, str(path)], stdout=subprocess.PIPE, cwd=ROOT
    )
    assert process.stdout is not None
    assert process.stdout.readline() == b"0\n"
    time.sleep(random.Random(seed).uniform(0.0, 0.3))
    process.send_signal(signal.SIGKILL)
    sent = int(process.communicate()[0].split()[-1])
    assert not path.exists()

    sink = RecordingSink(path)  # the next recording of the same name recovers it
    sink.open(HEADER)
    sink.send(live_frame(1))
    sink.close()
    tracks = am.io.read_tracks(tmp_path / "out.recovered.c3d")
    n = tracks.detections.n_frames
    # The frame that was being written when the process was killed may be there.
    assert sent + 1 <= n <= sent + 2
    np.testing.assert_allclose(tracks["A"][:, 0], range(n), atol=1e-6)
    assert am.read(path).n_frames == 1
    assert sorted(p.name for p in tmp_path.iterdir()) == ["out.c3d", "out.recovered.c3d"]


def test_every_cut_of_a_journal_can_be_read(tmp_path):
    path = tmp_path / "out.c3d"
    sink = RecordingSink(path)
    sink.open(HEADER)
    for t in range(1, 6):
        sink.send(live_frame(t))
    os.close(sink._file)
    data = journal_of(path).read_bytes()
    begin = len(data) - 5 * ((len(data) - data.index(b"}") - 1) // 5)
    for cut in range(begin, len(data)):
        journal_of(path).write_bytes(data[:cut])
        assert read_journal(journal_of(path)).detections.n_frames <= 4
    altered = bytearray(data)
    altered[-1] ^= 1
    journal_of(path).write_bytes(altered)
    assert read_journal(journal_of(path)).detections.n_frames == 4
    recover(path)
    assert am.read(path).n_frames == 4


def test_what_cannot_be_recorded_or_recovered(tmp_path):
    path = tmp_path / "out.c3d"
    with pytest.raises(FormatError, match="no such file"):
        recover(path)
    path.write_bytes(b"")
    with pytest.raises(SinkError, match="exists already"):
        RecordingSink(path).open(HEADER)
    path.unlink()
    journal_of(path).write_bytes(b"something else")
    with pytest.raises(SinkError, match="away"):
        RecordingSink(path).open(HEADER)
    assert journal_of(path).read_bytes() == b"something else"


@pytest.mark.skipif(sys.platform == "win32", reason="files are locked otherwise there")
def test_two_recordings_of_one_file(tmp_path):
    path = tmp_path / "out.c3d"
    first = RecordingSink(path)
    first.open(HEADER)
    first.send(live_frame(1))
    with pytest.raises(SinkError, match="another process records it"):
        RecordingSink(path).open(HEADER)
    first.close()
    assert am.read(path).n_frames == 1


def test_a_full_disk_leaves_the_frames_before(tmp_path, monkeypatch):
    path = tmp_path / "out.c3d"
    sink = RecordingSink(path)
    sink.open(HEADER)
    sink.send(live_frame(1))
    write = os.write

    def no_room(file, data):
        if len(data) > 10:
            return write(file, bytes(data)[:10])  # a part fits
        raise OSError(28, "No space left on device")

    monkeypatch.setattr(os, "write", no_room)
    sink.send(live_frame(2))
    monkeypatch.undo()
    sink.send(live_frame(3))
    sink.close()
    assert sink.faults == {"not written: No space left on device": 1}
    assert am.read(path).counts.tolist() == [3, 0, 3]


def test_a_recording_whose_c3d_cannot_be_written_keeps_its_journal(tmp_path, caplog):
    path = tmp_path / "out.c3d"
    sink = RecordingSink(path)
    sink.open(HEADER)
    sink.send(live_frame(1))
    path.mkdir()
    sink.close()
    assert sink.faults == {"no C3D": 1}
    assert str(journal_of(path)) in caplog.text
    recover(path, tmp_path / "other.c3d")
    assert am.read(tmp_path / "other.c3d").n_frames == 1
