"""How the report page looks: contrast, narrow screens, captures that are nearly empty or long."""

from __future__ import annotations

import dataclasses
import io
import re

import numpy as np
import pytest
from PIL import Image

import asterism as am
from tests.reporting.browser import CHROMIUM

pytestmark = pytest.mark.skipif(CHROMIUM is None, reason="needs Chromium: apt-get install chromium")


def place(page):
    return page.run(
        "(b => [b.x, b.y, b.width, b.height])"
        "(document.getElementById('scene').getBoundingClientRect())"
    )


CONTRASTS = """(() => {
  const parse = (c) => {
    const [r, g, b, a] = c.match(/[\\d.]+/g).map(Number);
    return [r, g, b, a ?? 1];
  };
  const light = ([r, g, b]) => [r, g, b].map((v) => v / 255).map((v) =>
    v <= 0.04045 ? v / 12.92 : ((v + 0.055) / 1.055) ** 2.4)
    .reduce((s, v, i) => s + v * [0.2126, 0.7152, 0.0722][i], 0);
  const behind = (e) => {
    for (let n = e; n; n = n.parentElement) {
      const c = parse(getComputedStyle(n).backgroundColor);
      if (c[3] === 1) return c;
    }
    return [255, 255, 255];
  };
  document.querySelectorAll("details").forEach((d) => { d.open = true; });
  asterism.choose(1);
  const low = [];
  let n = 0;
  const walker = document.createTreeWalker(document.body, NodeFilter.SHOW_TEXT);
  while (walker.nextNode()) {
    const e = walker.currentNode.parentElement;
    if (!walker.currentNode.textContent.trim() || !e.checkVisibility()) continue;
    if (["SCRIPT", "NOSCRIPT", "STYLE"].includes(e.tagName)) continue;
    const [a, b] = [light(parse(getComputedStyle(e).color)), light(behind(e))];
    const ratio = (Math.max(a, b) + 0.05) / (Math.min(a, b) + 0.05);
    n += 1;
    if (ratio < 4.5) low.push([e.tagName, e.className, e.id, ratio.toFixed(2)]);
  }
  return [n, low];
})()"""


@pytest.mark.parametrize("dark", [False, True])
def test_text_can_be_read(browser, person, dark):
    page = browser.page(person[0], dark=dark)
    n, low = page.run(CONTRASTS)
    assert n > 100
    assert low == []
    paper = page.run("getComputedStyle(document.body).backgroundColor")
    assert (int(re.findall(r"\d+", paper)[0]) < 128) == dark
    page.close()


@pytest.mark.parametrize("width", [375, 820])
def test_narrow_screens_need_no_scrolling_to_the_side(browser, person, width):
    page = browser.page(person[0], width=width, height=700)
    page.run("document.querySelectorAll('details').forEach(d => { d.open = true; })")
    page.run("asterism.choose(1)")
    page.settle()
    assert page.run("document.documentElement.scrollWidth") <= width
    assert place(page)[2] >= 0.85 * width - 60
    small = page.run("""[...document.querySelectorAll("button, select, input[type=range]")]
      .filter(e => e.checkVisibility() && e.getBoundingClientRect().height < 28).map(e => e.id)""")
    assert small == []
    page.close()


@pytest.mark.parametrize(("width", "height"), [(1400, 900), (1024, 768)])
def test_player_lists_and_timeline_fit_the_screen(browser, person, width, height):
    page = browser.page(person[0], width=width, height=height)
    for selector in (".cards", "#scene", "#places button", "#frame", "#strips"):
        top, bottom, right = page.run(
            f"(b => [b.top, b.bottom, b.right])(document.querySelector({selector!r})"
            ".getBoundingClientRect())"
        )
        assert 0 <= top < bottom <= height
        assert right <= width
    assert place(page)[3] >= 0.25 * height
    page.close()


def test_the_subject_fills_the_view_beside_strays(browser, tmp_path):
    truth = am.simulate.person(activity="walk", frames=200, seed=1)
    body = truth.positions()
    stray = np.full((200, 2, 3), 30.0) * [1, -1, 0]
    stray[:, 1] += 5
    tracks = am.Tracks.from_dense(
        truth.detections.times, np.concatenate([body, stray], axis=1), [*truth.names, "a", "b"]
    )
    am.report(tracks, tmp_path / "page.html")
    page = browser.page(tmp_path / "page.html", width=1400)
    _, _, width, height = place(page)
    for frame in (0, 100, 199):
        page.run(f"asterism.seek({frame})")
        page.settle()
        spots = np.array([page.run(f"asterism.where({k})") for k in range(len(truth.names))])
        assert (spots > 0).all()
        assert (spots < [width, height]).all()
        assert np.ptp(spots[:, 1]) > 0.6 * height
    page.run("document.getElementById('fit').click()")
    page.settle()
    spots = np.array([page.run(f"asterism.where({k})") for k in range(len(truth.names))])
    assert np.ptp(spots[:, 1]) < 0.3 * height  # the whole scene has the strays
    page.close()


def empty(n_frames, n_axes=3):
    d = am.Detections(
        times=np.arange(n_frames) / 100,
        offsets=np.zeros(n_frames + 1, int),
        points=np.empty((0, n_axes)),
    )
    return am.Tracks(detections=d, labels=np.empty(0, int))


def odd_captures():
    """Captures of which little is left, or something is missing."""
    rng = np.random.default_rng(1)
    points = rng.normal(0, 1, (1, 5, 3))
    one = am.Tracks.from_dense([0.0], points, list("abcde"))
    flat = np.cumsum(rng.normal(0, 0.01, (50, 4, 2)), axis=0) + rng.normal(0, 1, (4, 2))
    still = np.tile(points, (10, 1, 1))
    return {
        "no frame": empty(0),
        "no point": empty(5),
        "flat, no point": empty(3, 2),
        "one frame": one,
        "no track": dataclasses.replace(one, labels=np.full(5, -1), names=()),
        "flat": am.Tracks.from_dense(np.arange(50) / 50, flat),
        "nothing moves": am.Tracks.from_dense(np.arange(10), still),
        "one point": am.Tracks.from_dense([2.0], [[[1.0, 2.0, 3.0]]]),
        "an empty track": dataclasses.replace(one, names=("a", "b", "c", "d", "e", "never")),
    }


@pytest.mark.parametrize("name", list(odd_captures()))
def test_odd_captures_have_a_page(browser, tmp_path, name):
    tracks = odd_captures()[name]
    am.report(tracks, tmp_path / "page.html")
    page = browser.page(tmp_path / "page.html")
    for key in ("End", " ", " ", "n", "]", "f", "d", "Home"):
        page.key(key)
    page.settle()
    assert page.complaints() == []
    lead = page.run("document.querySelector('.lead').textContent")
    said = {"no frame": "empty", "no track": "all clutter", "flat": "2-D"}
    assert said.get(name, "") in lead
    if tracks.detections.n_points and tracks.n_tracks:
        picture = Image.open(io.BytesIO(page.screenshot())).convert("RGB")
        x, y, w, h = place(page)
        drawn = np.asarray(picture)[int(y) : int(y + h), int(x) : int(x + w)]
        assert drawn.astype(float).std() > 1
        assert page.run("asterism.where(0)") is not None
    page.close()


def test_five_minutes_are_quick(browser, tmp_path):
    rng = np.random.default_rng(1)
    T, n = 36_000, 60
    t = np.arange(T)[:, None] / 120
    places = np.empty((T, n, 3))
    for axis in range(3):
        pace, start = rng.uniform(0.3, 1.2, n), rng.uniform(0, 6, n)
        places[:, :, axis] = rng.uniform(-0.9, 0.9, n) + 0.2 * np.sin(2 * np.pi * pace * t + start)
    places[:, :, 0] += 1.5 * np.sin(0.3 * t)
    places += rng.normal(0, 3e-4, places.shape)
    tracks = am.Tracks.from_dense(t[:, 0], places)
    tracks = dataclasses.replace(tracks, confidence=1 - 0.05 * rng.random(T * n) ** 4)
    am.report(tracks, tmp_path / "page.html")
    assert (tmp_path / "page.html").stat().st_size <= 25_000_000
    page = browser.page(tmp_path / "page.html")
    took = page.run("""(async () => {
      const took = [];
      for (const frame of [9, 30000, 17, 18000, 35999, 2, 24000, 301]) {
        asterism.seek(frame);
        took.push(Number(document.body.dataset.drawn));
        await new Promise((r) => requestAnimationFrame(() => requestAnimationFrame(r)));
      }
      return took;
    })()""")
    assert np.median(took) < 50
    page.close()
