"""The page of a stream: its server, and the page in a headless browser."""

from __future__ import annotations

import http.client
import itertools
import json
import threading
from urllib.parse import parse_qs, urlparse

import numpy as np
import pytest

import asterism as am
from asterism.errors import SinkError
from asterism.live import LiveFrame, LiveRun, StreamHeader
from asterism.live.sinks.page import PageSink
from asterism.live.sinks.parse import parse_sink
from asterism.tracking import TrackStates
from tests.reporting.browser import CHROMIUM, Browser

N = 100


def frame(number):
    """100 markers on a grid that moves, some of them occluded, and a point of clutter."""
    at = np.stack(np.meshgrid(np.arange(10), np.arange(5), np.arange(2)), axis=-1).reshape(-1, 3)
    at = 0.2 * at + [0.002 * number, 0, 0.1]
    gaps = np.where(np.arange(N) % 10 == number // 60 % 10, 3, 0)
    means = np.stack([at, np.zeros_like(at)], axis=2)
    names = tuple(f"M{k}" if k % 2 else None for k in range(N))
    tracks = TrackStates(
        ids=np.arange(N) + 7, means=means, covariances=np.tile(np.eye(2), (N, 1, 1)), gaps=gaps,
        names=names,
    )  # fmt: skip
    seen = gaps == 0
    points = np.concatenate([at[seen], [[0.5, 0.5, 1.5]]])
    labels = np.append(tracks.ids[seen], -1)
    return LiveFrame(
        number=number, time=number / 100, points=points, labels=labels, read_tracks=lambda: tracks
    )


class Shown:
    """A page with frames at 100 Hz."""

    def __init__(self):
        address = []
        self.sink = PageSink(on_address=address.append)
        self.sink.open(StreamHeader(source="a <b>stream</b>"))
        (self.address,) = address
        parts = urlparse(self.address)
        self.port, self.token = parts.port, parse_qs(parts.query)["token"][0]
        latency = am.live.LatencyHistogram()
        for k in range(1, 1000):
            latency.add(2e-4 + 1e-6 * k)
        faults = {"lost": 12, "reordered": 3}
        self.sink.show(
            LiveRun(source="x", n_frames=999, n_tracks=N, rate=100.0, latency=latency,
                    faults=faults, n_models=2)
        )  # fmt: skip
        self._links = []
        self._stop = threading.Event()
        self._thread = threading.Thread(target=self._send)
        self._thread.start()

    def _send(self):
        number = 0
        while not self._stop.wait(0.01):
            self.sink.send(frame(number))
            number += 1

    def get(self, path, **headers):
        link = http.client.HTTPConnection("127.0.0.1", self.port, timeout=20)
        self._links.append(link)
        link.request("GET", path, headers=headers)
        return link.getresponse()

    def close(self):
        self._stop.set()
        self._thread.join()
        self.sink.close()
        for link in self._links:
            link.close()


@pytest.fixture
def shown():
    made = Shown()
    yield made
    made.close()


def test_frames_names_and_counts_arrive_as_lines(shown):
    answer = shown.get("/frames", **{"x-asterism-token": shown.token})
    assert answer.status == 200
    lines = []
    while not any("health" in line for line in lines) or len(lines) < 6:
        lines.append(json.loads(answer.readline()))
    frames = [line for line in lines if "frame" in line]
    assert all(a["frame"] < b["frame"] for a, b in itertools.pairwise(frames))
    one = frames[0]
    assert one["ids"] == list(range(7, 7 + N))
    made = frame(one["frame"])
    np.testing.assert_allclose(
        np.reshape(one["at"], (N, 3)) / 1e4, made.tracks.positions, atol=5e-5
    )
    assert one["seen"] == made.tracks.is_seen.astype(int).tolist()
    assert one["clutter"] == [5000, 5000, 15000]
    (names,) = (line["names"] for line in lines if "names" in line)
    assert names["8"] == "M1"
    health = next(line["health"] for line in lines if "health" in line)
    assert health["faults"] == [["lost", 12], ["reordered", 3]]
    assert health["info"]["rate"] == 100
    assert health["info"]["drift"] is None


def test_nothing_is_answered_without_the_secret(shown):
    assert shown.get("/frames").status == 403
    assert shown.get("/").status == 403
    assert shown.get("/?token=x").status == 403
    answer = shown.get(f"/?token={shown.token}")
    text = answer.read().decode()
    assert "a &lt;b&gt;stream&lt;/b&gt;" in text
    assert "<b>stream" not in text


def test_the_port_is_for_this_machine_and_must_be_free(shown):
    with pytest.raises(SinkError, match="expected a free port"):
        PageSink(shown.port).open(StreamHeader(source="x"))
    with pytest.raises(am.ParameterError, match="this machine only"):
        parse_sink("page://0.0.0.0:8000")
    assert parse_sink("page://:8000").name == "page://:8000"


def test_a_page_that_is_closed_ends_its_streams(shown):
    answer = shown.get("/frames", **{"x-asterism-token": shown.token})
    assert answer.readline()
    shown.sink.close()
    while answer.readline():
        pass
    with pytest.raises(ConnectionRefusedError):
        shown.get("/")


@pytest.mark.skipif(CHROMIUM is None, reason="needs Chromium: apt-get install chromium")
@pytest.mark.parametrize("dark", [False, True], ids=["light", "dark"])
def test_the_page_draws_the_markers(shown, dark):
    browser = Browser()
    try:
        page = browser.page(shown.address, dark=dark)
        page.wait("asterism.capture.slots.size === 100 && document.body.dataset.fps > 0")
        page.wait("document.getElementById('tracks').textContent === '100'")
        assert page.complaints() == []
        assert page.run("document.getElementById('rate').textContent") == "100.0 Hz"
        assert "0.7" in page.run("document.getElementById('quantiles').textContent")
        faults = page.run("document.getElementById('faults').innerText").split()
        assert faults == ["lost", "12", "reordered", "3"]
        x = page.run("asterism.capture.positions[0]")
        page.wait(f"asterism.capture.positions[0] > {x}")
        hollow = page.run("[...asterism.capture.filled.slice(0, 100)].reduce((a, b) => a + b)")
        assert hollow == 10
        assert page.run("document.getElementById('state').hidden")
        page.run("document.getElementById('show-names').click()")
        page.settle()
        assert (
            page.run("asterism.capture.header.names.filter((n) => n.startsWith('M')).length") == 50
        )
    finally:
        browser.close()
