"""The report page in a headless browser, opened from the disk."""

from __future__ import annotations

import dataclasses
import io

import numpy as np
import pytest
from PIL import Image

import asterism as am
from tests.reporting.browser import CHROMIUM
from tests.reporting.cases import HOSTILE

pytestmark = pytest.mark.skipif(CHROMIUM is None, reason="needs Chromium: apt-get install chromium")


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


def test_the_page_loads_nothing_and_logs_no_error(browser, person):
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
    shown = opened.run("[...document.querySelectorAll('#places bdi')].map(b => b.textContent)")
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
    opened.run("asterism.choose(-1)")
    opened.run(f"asterism.seek({person[1].decisions[0].first})")
    opened.key("m")
    opened.settle()
    apart = np.hypot(*np.subtract(*(opened.run(f"asterism.where({k})") for k in (0, 1))))
    opened.run("asterism.seek(0)")
    opened.run("document.querySelector('#places button').click()")
    opened.settle()
    state = opened.run("asterism.state()")
    tracks = person[1]
    assert state["chosen"] == 0
    assert state["frame"] == tracks.decisions[0].first
    assert state["involved"] == [0, 1]
    assert state["follow"]
    assert state["speed"] == 0.25
    assert opened.run("document.getElementById('speed').value") == "0.25"
    confidence = "document.querySelector('[data-about=\"identity confidence\"]').textContent"
    assert opened.run(confidence) == "35 %"
    # The involved markers are framed: amid the view, and apart.
    _, _, width, height = box(opened, "#scene")
    spots = np.array([opened.run(f"asterism.where({k})") for k in (0, 1)])
    assert np.hypot(*np.subtract(*spots)) > 1.5 * apart
    spots /= [width, height]
    assert (np.abs(spots - 0.5) < 0.45).all()
    assert np.abs(spots.mean(axis=0) - 0.5).max() < 0.2
    before = opened.run("asterism.where(0)")
    opened.key("ArrowRight", shift=True)
    opened.settle()
    assert np.allclose(opened.run("asterism.where(0)"), before, atol=1)  # it is followed
    assert not opened.run("document.querySelector('.others').open")
    opened.key("n")
    assert opened.run("document.querySelectorAll('[aria-current]').length") == 1
    assert opened.run("document.querySelector('.others').open")
    opened.key("p")
    assert opened.run("document.querySelector('#places [aria-current]') !== null")
    opened.key("Escape")
    assert opened.run("asterism.state()")["involved"] == []


def strips(page):
    """Content of the timeline as an array."""
    png = Image.open(io.BytesIO(page.screenshot())).convert("RGB")
    x, y, w, h = box(page, "#strips")
    return np.asarray(png)[int(y) : int(y + h), int(x) : int(x + w)].astype(float)


def test_marks_of_the_truth_are_switched(browser, tmp_path):
    truth = am.simulate.cube(seed=1, frames=60)
    labels = truth.labels.copy()
    late = truth.detections.frame_of >= 40
    labels[late & (truth.labels == 2)], labels[late & (truth.labels == 5)] = 5, 2
    am.report(dataclasses.replace(truth, labels=labels), tmp_path / "swapped.html", truth=truth)
    page = browser.page(tmp_path / "swapped.html")
    assert page.run("asterism.capture.verdict.filter(v => v === 1).length") == 40
    page.run("asterism.seek(50)")
    with_truth, scene = strips(page), image_of(page)
    switch = "document.getElementById('show-truth').click()"
    page.run(switch)
    assert np.abs(strips(page) - with_truth).max() > 50
    assert np.abs(image_of(page) - scene).max() > 50
    page.run(switch)
    assert np.abs(strips(page) - with_truth).max() == 0
    assert np.abs(image_of(page) - scene).max() == 0
    page.close()


def test_colours_are_of_tracks_or_of_segments(browser, person):
    page = browser.page(person[0])
    n_tracks, n_segments = page.run("""(() => {
      const { segments, header } = asterism.capture;
      const n = header.colours.cycle.length;
      const hues = () => [...segments.keys()].map(k => asterism.hue(k));
      const tracks = hues().every((hue, k) => hue === k % n);
      const select = document.getElementById("colours");
      select.value = "segment";
      select.dispatchEvent(new Event("change"));
      const own = hues().every((hue, k) => hue === (segments[k] < 0 ? -1 : segments[k] % n));
      return [tracks, own];
    })()""")
    assert n_tracks
    assert n_segments
    by_segment = image_of(page)
    page.run("""(s => { s.value = "track"; s.dispatchEvent(new Event("change")); })
      (document.getElementById("colours"))""")
    assert np.abs(image_of(page) - by_segment).max() > 50
    page.close()


def test_a_click_chooses_the_marker_under_it(opened, person):
    tracks = person[1]
    opened.run("asterism.seek(60); document.getElementById('fit').click()")
    opened.settle()
    x, y, _, _ = box(opened, "#scene")
    there = tracks.labels[tracks.detections.frame_of == 60]
    places = {k: opened.run(f"asterism.where({k})") for k in there[there >= 0].tolist()}

    def gap(k):
        return min(np.hypot(*np.subtract(places[k], places[j])) for j in places if j != k)

    alone = max(places, key=gap)
    opened.click(x + places[alone][0] + 2, y + places[alone][1] - 1)
    assert opened.run("asterism.state().chosen") == alone
    shown_at = opened.run("document.querySelector('[data-about=position]').textContent")
    here = (tracks.labels == alone) & (tracks.detections.frame_of == 60)
    shown = np.array([float(part) for part in shown_at.split(", ")])
    assert np.abs(shown - 1000 * tracks.detections.points[here][0]).max() < 0.2
    opened.run("asterism.choose(-1)")


def test_gaps_are_drawn_straight(opened, person):
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
    shown_at = opened.run("document.querySelector('[data-about=position]').textContent")
    assert np.abs(np.array([float(x) for x in shown_at.split(", ")]) - 1000 * expected).max() < 0.2
    assert "occluded" in opened.run("document.querySelector('[data-about=state]').textContent")
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
    controls += ["colours", "show-lines", "show-clutter", "show-truth", "show-cameras", "up"]
    controls += ["track-subject", "fit", "order", "strips"]
    assert [name for name in ids if name in controls] == controls
    assert unmarked == []
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


def test_the_page_opens_on_the_first_full_frame(browser, tmp_path):
    truth = am.simulate.cube(seed=1, frames=60)
    frames = [truth.detections.frame(t)[: 0 if t < 20 else 8] for t in range(60)]
    d = am.Detections.from_frames(truth.detections.times, frames)
    tracks = am.Tracks(detections=d, labels=np.tile(np.arange(8), 40))
    am.report(tracks, tmp_path / "late.html")
    page = browser.page(tmp_path / "late.html")
    assert page.run("asterism.state().frame") == 20
    assert page.run("document.getElementById('frame').value") == "20"
    assert page.run("document.getElementById('clock').textContent") == "20.000 s · frame 20"
    assert page.run("asterism.where(0)") is not None  # a marker is on the canvas
    page.close()
