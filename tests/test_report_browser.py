"""The report page in a headless browser, opened from the disk."""

from __future__ import annotations

import dataclasses
import io
import re

import numpy as np
import pytest
from PIL import Image

import asterism as am
from browser import CHROMIUM, Browser
from report_cases import HOSTILE, spoilt_person

pytestmark = pytest.mark.skipif(CHROMIUM is None, reason="needs Chromium: apt-get install chromium")

K = am.intrinsics(focal_length=900, principal_point=(639.5, 511.5))


@pytest.fixture(scope="module")
def browser():
    made = Browser()
    yield made
    made.close()


@pytest.fixture(scope="module")
def person(tmp_path_factory):
    """A page with all there can be: truth, cameras with lenses, confidence, hostile names."""
    truth, tracks = spoilt_person()
    names = [*HOSTILE, *(f"M{k}" for k in range(tracks.n_tracks - len(HOSTILE)))]
    tracks = dataclasses.replace(tracks, names=tuple(names))
    order, starts = tracks.by_track
    confidence = tracks.confidence.copy()
    confidence[order[starts[0] + 20 : starts[0] + 30]] = 0.4  # that the first is to be looked at
    labels = tracks.labels.copy()
    labels[order[starts[7] + 40 : starts[7] + 49]] = -1  # that there is a long gap
    tracks = dataclasses.replace(tracks, confidence=confidence, labels=labels)
    ring = am.Rig.ring(8, radius=4, height=2.5).cameras
    lens = am.BrownConrady(k1=-0.2)
    ring = tuple(dataclasses.replace(c, K=K, lens=lens) for c in ring)
    # One amid the points: some are behind it, some too near, some too far.
    amid = am.Camera.look_at((0, 0, 1), (2, 0.1, 1), K=K, size_px=(1280, 1024), name="amid")
    points = tracks.detections.points
    pose = amid.T_camera_world
    seen = points[amid.project(points).visible] @ pose[2, :3] + pose[2, 3]
    near, far = (float(depth) for depth in np.quantile(seen, [0.2, 0.8]))
    amid = dataclasses.replace(amid, near=near, far=far)
    rig = am.Rig((*ring, amid))
    path = tmp_path_factory.mktemp("person") / "page.html"
    am.report(tracks, path, truth=truth, rig=rig, title=HOSTILE[0])
    return path, tracks, truth, rig


@pytest.fixture(scope="module")
def opened(browser, person):
    page = browser.page(person[0])
    yield page
    page.close()


def image_of(page):
    """What is on the canvas of the scene, as an array."""
    png = Image.open(io.BytesIO(page.screenshot())).convert("RGB")
    x, y, w, h = box(page, "#scene")
    return np.asarray(png)[int(y) : int(y + h), int(x) : int(x + w)].astype(float)


def box(page, selector):
    return page.run(
        f"(b => [b.x, b.y, b.width, b.height])(document.querySelector({selector!r})"
        ".getBoundingClientRect())"
    )


def test_asks_nobody_and_complains_of_nothing(browser, person):
    page = browser.page(person[0])
    for key in (" ", "ArrowRight", "n", "l", "f", "d", "w", "+", "0"):
        page.key(key)
        page.settle()
    assert page.complaints() == []
    assert page.requests() == [person[0].as_uri()]
    page.close()


def test_policy_is_in_force(browser, person):
    page = browser.page(person[0])
    blocked = page.run("""(async () => {
      const found = [];
      addEventListener("securitypolicyviolation", (e) => found.push(e.effectiveDirective));
      const tried = [
        () => { document.body.innerHTML = "<b>x</b>"; },
        () => { new Image().src = "https://nowhere.invalid/x.png"; },
        () => fetch("https://nowhere.invalid/").catch(() => 0),
        () => { document.body.setAttribute("style", "color: red"); },
      ];
      for (const attempt of tried) {
        try { await attempt(); } catch (error) { found.push(error.name); }
      }
      await new Promise((r) => setTimeout(r, 200));
      return found;
    })()""")
    for directive in ("require-trusted-types-for", "TypeError", "img-src", "connect-src"):
        assert directive in blocked
    assert "style-src-attr" in blocked
    page.close()


def test_names_from_files_do_nothing(opened):
    assert opened.run("document.querySelectorAll('script').length") == 1  # the data is taken out
    assert opened.run("document.querySelectorAll('img').length") == 0
    assert opened.run("document.querySelector('h1').textContent") == HOSTILE[0]
    shown = opened.run("[...document.querySelectorAll('#findings bdi')].map(b => b.textContent)")
    assert HOSTILE[0] in shown
    for k, name in enumerate(HOSTILE):
        opened.run(f"asterism.choose({k})")
        assert opened.run("document.querySelector('[data-about=name]').textContent") == name
    opened.run("asterism.choose(-1)")


def test_points_are_where_python_has_them(opened, person):
    _, tracks, _, _ = person
    order, starts = tracks.by_track
    at = opened.run("Array.from(asterism.capture.positions)")
    found = np.reshape(at, (-1, 3))[: len(order)]
    assert np.abs(found - tracks.detections.points[order]).max() < 2e-4
    assert opened.run("Array.from(asterism.capture.starts)") == starts.tolist()
    assert opened.run("asterism.capture.T") == tracks.detections.n_frames


def test_keys_play_step_and_seek(opened, person):
    frame = "asterism.state().frame"
    opened.run("asterism.seek(0)")
    for key, shift, expected in (
        ("ArrowRight", False, 1), ("ArrowRight", True, 11), ("ArrowLeft", False, 10),
        ("End", False, 119), ("Home", False, 0),
    ):  # fmt: skip
        opened.key(key, shift=shift)
        assert opened.run(frame) == expected
    opened.key(" ")
    assert opened.run("asterism.state().playing")
    opened.wait(f"{frame} > 3")
    opened.key(" ")
    assert not opened.run("asterism.state().playing")
    stopped = opened.run(frame)
    opened.settle()
    assert opened.run(frame) == stopped
    clock = opened.run("document.getElementById('clock').textContent")
    assert clock == f"{person[1].detections.times[stopped]:.3f} s · frame {stopped}"


def test_list_leads_to_the_place(opened, person):
    entry = "document.querySelector('#findings [data-kind=low-confidence]')"
    opened.run(f"{entry}.click()")
    state = opened.run("asterism.state()")
    assert state["chosen"] == 0
    tracks = person[1]
    here = (tracks.labels == 0) & (tracks.detections.frame_of == state["frame"])
    assert tracks.confidence[here] == 0.4
    assert opened.run("document.querySelector('[data-about=confidence]').textContent") == "40 %"
    opened.key("n")
    assert opened.run("document.querySelectorAll('[aria-current]').length") == 1


def test_a_click_chooses_the_marker_under_it(opened, person):
    tracks = person[1]
    opened.run("asterism.seek(60); document.getElementById('fit').click()")
    opened.settle()
    x, y, _, _ = box(opened, "#scene")
    there = tracks.labels[tracks.detections.frame_of == 60]
    places = {k: opened.run(f"asterism.where({k})") for k in there[there >= 0].tolist()}
    gap = lambda k: min(np.hypot(*np.subtract(places[k], places[j])) for j in places if j != k)  # noqa: E731
    alone = max(places, key=gap)
    opened.click(x + places[alone][0] + 2, y + places[alone][1] - 1)
    assert opened.run("asterism.state().chosen") == alone
    told = opened.run("document.querySelector('[data-about=place]').textContent")
    here = (tracks.labels == alone) & (tracks.detections.frame_of == 60)
    shown = np.array([float(part) for part in told.split(", ")])
    assert np.abs(shown - 1000 * tracks.detections.points[here][0]).max() < 0.2
    opened.run("asterism.choose(-1)")


def test_gaps_are_bridged_straight(opened, person):
    tracks = person[1]
    places = tracks.positions()
    k = 7
    seen = np.flatnonzero(np.isfinite(places[:, k, 0]))
    longest = int(np.argmax(np.diff(seen)))
    a, b = int(seen[longest]), int(seen[longest + 1])
    assert b - a > 8
    t = a + 2
    expected = places[a, k] + (t - a) / (b - a) * (places[b, k] - places[a, k])
    opened.run(f"asterism.choose({k}); asterism.seek({t})")
    told = opened.run("document.querySelector('[data-about=place]').textContent")
    assert np.abs(np.array([float(x) for x in told.split(", ")]) - 1000 * expected).max() < 0.2
    assert "not seen" in opened.run("document.querySelector('[data-about=now]').textContent")
    opened.run("asterism.choose(-1)")


def test_cameras_see_what_python_says(opened, person):
    _, tracks, _, rig = person
    d = tracks.detections
    amid = []
    for t in (1, 5, 9, 90):
        here = (d.frame_of == t) & (tracks.labels >= 0)
        seen = rig.project(d.points[here])
        amid += seen.visible[-1].tolist()
        for i, (own, is_seen) in enumerate(zip(seen.pixels, seen.visible, strict=True)):
            opened.run(
                f"(s => {{ s.value = {i}; s.dispatchEvent(new Event('change')); }})"
                "(document.getElementById('camera'))"
            )
            opened.run(f"asterism.seek({t})")
            assert int(opened.run("document.getElementById('image').dataset.seen")) == is_seen.sum()
            for n in (*np.flatnonzero(is_seen)[:2], *np.flatnonzero(~is_seen)[:2]):
                pixel = opened.run(f"asterism.pixel({tracks.labels[here][n]})")
                assert (pixel is not None) == is_seen[n]
                assert pixel is None or np.abs(np.subtract(pixel, own[n])).max() < 0.5
    assert 0 < np.mean(amid) < 1


def test_figures_in_the_page_are_those_of_python(opened, person):
    _, tracks, truth, _ = person
    e = am.evaluate(tracks, truth)
    score = "document.querySelector('[data-score=\"{}\"]').textContent"
    assert opened.run(score.format("IDF1")) == f"{e.idf1:.4f}"
    assert opened.run(score.format("Missed")) == f"{e.missed:,}"
    n_missed = opened.run("asterism.capture.verdict.reduce((n, v) => n + (v === 2), 0)")
    n_wrong = opened.run("asterism.capture.verdict.reduce((n, v) => n + (v === 1), 0)")
    assert n_missed == e.missed
    assert n_wrong == round(e.wrong_percent / 100 * (tracks.labels >= 0).sum())
    fact = opened.run("document.querySelector('[data-fact=clutter]').textContent")
    assert fact == f"{(tracks.labels < 0).sum():,}"


def test_something_is_seen(opened):
    opened.run("asterism.seek(60)")
    picture = image_of(opened)
    assert picture.std() > 4
    colours = np.unique(picture.reshape(-1, 3).round(-1), axis=0)
    assert len(colours) > 40
    opened.run("asterism.seek(100)")
    assert np.abs(image_of(opened) - picture).max() > 100  # and it moves


def test_all_controls_are_reached_by_tab_in_their_order(browser, person):
    page = browser.page(person[0])
    ids, unmarked = [], []
    for _ in range(120):
        page.key("Tab")
        name, outline = page.run("""(e => [e.id || e.tagName, getComputedStyle(e).outlineStyle
          + " " + getComputedStyle(e).outlineWidth])(document.activeElement)""")
        if name == "BODY" or (ids and name == ids[0]):
            break
        ids.append(name)
        if outline.startswith("none") or outline.endswith(" 0px"):
            unmarked.append(name)
    controls = ["scene", "play", "back", "on", "frame", "speed", "camera", "show-names", "trails"]
    controls += ["show-lines", "show-clutter", "show-cameras", "up", "fit", "order", "strips"]
    assert [name for name in ids if name in controls] == controls
    assert unmarked == []
    page.close()


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
    assert box(page, "#scene")[2] >= 0.85 * width - 60
    small = page.run("""[...document.querySelectorAll("button, select, input[type=range]")]
      .filter(e => e.checkVisibility() && e.getBoundingClientRect().height < 28).map(e => e.id)""")
    assert small == []
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
    said = {"no frame": "empty", "no track": "all clutter", "flat": "flat"}
    assert said.get(name, "") in lead
    if tracks.detections.n_points and tracks.n_tracks:
        assert image_of(page).std() > 1
        assert page.run("asterism.where(0)") is not None
    page.close()


def test_without_webgl_all_else_works(browser, person):
    deaf = """const was = HTMLCanvasElement.prototype.getContext;
      HTMLCanvasElement.prototype.getContext = function (kind, ...rest) {
        return kind.startsWith("webgl") ? null : was.call(this, kind, ...rest);
      };"""
    page = browser.page(person[0], before=deaf)
    assert "no WebGL" in page.run("document.getElementById('state').textContent")
    page.key("ArrowRight")
    assert page.run("asterism.state().frame") == 1
    assert int(page.run("document.getElementById('image').dataset.seen")) > 0
    assert page.events("Runtime.exceptionThrown") == []
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
