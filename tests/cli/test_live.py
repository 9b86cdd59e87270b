"""``asterism live`` as a process and in this one."""

from __future__ import annotations

import json
import signal
import socket
import subprocess
import sys
import time
from pathlib import Path

import numpy as np
import pytest

import asterism as am
from asterism.cli import main

RUN = "import sys; from asterism.cli import main; sys.exit(main(sys.argv[1:]))"


@pytest.fixture
def capture(tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)
    truth = am.simulate.cube(frames=300, rate=60, seed=1)
    burst = am.simulate.Burst(n=1, shortest=5, longest=20)
    made = am.simulate.corrupt(truth, burst=burst, noise=3e-4, seed=1)
    am.write(made.detections, tmp_path / "in.c3d")
    am.estimate_model(made.detections).model.to_toml(tmp_path / "model.toml")
    return made


def test_a_capture_is_replayed_into_several_sinks(capture, capsys):
    line = "live in.c3d?speed=max --model model.toml --to out.jsonl --to out.csv --json"
    assert main(line.split()) == 0
    said = json.loads(capsys.readouterr().out)
    assert said["frames"] == 300
    assert said["models"] == 1
    assert said["latency_median"] > 0
    assert said["model"] == am.TrackingModel.from_toml("model.toml").to_dict()
    lines = list(map(json.loads, Path("out.jsonl").read_text(encoding="utf-8").splitlines()))
    assert [line["frame"] for line in lines] == list(range(1, 301))
    tracks = am.io.read_tracks("out.csv")
    found = am.evaluate(tracks, capture)
    assert found.idf1 > 0.95
    # The labels are those of a stream in Python.
    method = am.tracking.Stitched()
    state = method.init(am.TrackingModel.from_toml("model.toml"))
    for line, (now, points) in zip(lines, am.read("in.c3d"), strict=True):
        state, update = method.step(state, now, points)
        assert line["labels"] == update.labels.tolist()


def test_the_counts_are_a_table(capture, capsys):
    line = "live in.c3d?speed=max --model model.toml --method gnn"
    assert main(line.split()) == 0
    text = capsys.readouterr().out
    assert "300 at 60 Hz" in text
    assert "median" in text


@pytest.mark.parametrize(
    ("seconds", "text"),
    [
        (1.234e-5, "0.0123 ms"), (1.234e-3, "1.23 ms"), (0.0123456, "12.3 ms"),
        (0.0999, "99.9 ms"), (0.1, "100 ms"), (0.23456, "235 ms"), (2.5, "2,500 ms"),
    ],
)  # fmt: skip
def test_latencies_are_in_milliseconds_with_three_digits(monkeypatch, capsys, seconds, text):
    latency = am.live.LatencyHistogram()
    latency.add(seconds)
    run = am.live.LiveRun(source="trial.c3d", n_frames=1, rate=60.0, latency=latency)
    monkeypatch.setattr("asterism.live.run", lambda *_, **__: run)
    assert main(["live", "trial.c3d"]) == 0
    row = next(line for line in capsys.readouterr().out.splitlines() if "latency" in line)
    assert row.split(maxsplit=1)[1] == f"median {text}, 99 % {text}, 99.9 % {text}"


def test_standard_output_is_a_sink_and_nothing_else(capture, capsys):
    line = "live in.c3d?speed=max --model model.toml --to -"
    assert main(line.split()) == 0
    lines = capsys.readouterr().out.splitlines()
    assert len(lines) == 300
    assert json.loads(lines[-1])["tracks"]["seen"][0] in (True, False)


@pytest.mark.parametrize("number", [signal.SIGINT, signal.SIGTERM])
def test_a_signal_ends_the_stream_and_finishes_the_files(capture, number):
    with socket.socket(socket.AF_INET, socket.SOCK_DGRAM) as probe:
        probe.bind(("127.0.0.1", 0))
        port = probe.getsockname()[1]
    process = subprocess.Popen(
        [sys.executable, "-c", RUN, "live", f"udp://127.0.0.1:{port}", "--model", "model.toml",
         "--to", "out.c3d", "--to", "out.jsonl", "--json"],
        stdout=subprocess.PIPE, stderr=subprocess.PIPE, text=True,
        preexec_fn=lambda: signal.signal(signal.SIGINT, signal.default_int_handler),
    )  # fmt: skip
    d = capture.detections
    n_sent = 0
    with socket.socket(socket.AF_INET, socket.SOCK_DGRAM) as sender:
        end = time.monotonic() + 60
        lines = 0
        while lines < 20 and time.monotonic() < end:
            line = {"frame": n_sent, "time": n_sent / 60, "points": d.frame(n_sent % 300).tolist()}
            sender.sendto(json.dumps(line).encode(), ("127.0.0.1", port))
            n_sent += 1
            time.sleep(0.02)
            try:
                lines = Path("out.jsonl").read_bytes().count(b"\n")
            except FileNotFoundError:
                lines = 0
    process.send_signal(number)
    out, err = process.communicate(timeout=60)
    assert process.returncode == 0, err
    said = json.loads(out)
    assert said["frames"] >= 20
    recorded = am.read("out.c3d")
    assert recorded.n_frames >= said["frames"]
    assert np.isfinite(recorded.points).all()


@pytest.mark.parametrize(
    ("line", "says"),
    [
        ("live nowhere.c3d", "nowhere.c3d"),
        ("live udp://127.0.0.1", "udp://HOST:PORT"),
        ("live http://x", "qtm://"),
        ("live in.c3d --to out.zip", "ending in .c3d"),
        ("live in.c3d --to page://0.0.0.0:80", "this machine only"),
        ("live in.c3d --method nothing", "--method"),
        ("live in.c3d --model nowhere.toml", "nowhere.toml"),
        ("live in.c3d --markers nowhere.toml", "nowhere.toml"),
    ],
)
def test_what_cannot_be_is_one_line(capture, capsys, line, says):
    assert main(line.split()) == 2
    out, err = capsys.readouterr()
    assert out == ""
    assert err.count("\n") == 1
    assert says in err
