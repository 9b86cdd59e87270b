"""The editor in a headless browser: whole sessions by keyboard and by pointer."""

from __future__ import annotations

import numpy as np
import pytest

import asterism as am
from tests.edit.editors import recipe_of
from tests.edit.served import CAPTURE
from tests.reporting.browser import CHROMIUM

pytestmark = pytest.mark.skipif(CHROMIUM is None, reason="needs Chromium: apt-get install chromium")

STATE = "document.getElementById('edit-state').textContent"
DECISION = "document.getElementById('decision').innerText"
ERROR = "document.getElementById('edit-error').textContent"


def opened(browser, served, **options):
    """Open the page, and wait for its first decision."""
    page = browser.page(served.address, **options)
    page.wait("document.querySelector('.question') !== null")
    return page


def on_disk(page, n):
    page.wait(f"{STATE} === '{n} edit{'' if n == 1 else 's'} on disk' || {ERROR} !== ''")
    assert page.run(ERROR) == ""


def assessed(page):
    page.wait(f"!{DECISION}.includes('Assessing')")


def edits_of(served):
    return am.io.read_edits(served.folder / "trial.edits.toml", am.read(served.folder / CAPTURE))


def session_of(served, method=None, path="trial.edits.toml"):
    capture = am.read(served.folder / CAPTURE)
    return am.edit.Session.open(capture, served.folder / path, recipe_of(capture, method))


def centre(page, selector):
    return page.run(
        f"(b => [b.x + b.width / 2, b.y + b.height / 2])(document.querySelector({selector!r})"
        ".getBoundingClientRect())"
    )


def press(page, selector):
    """Click on an element with the pointer."""
    page.run(f"document.querySelector({selector!r}).scrollIntoView({{ block: 'nearest' }})")
    page.settle()
    page.click(*centre(page, selector))


def assert_clean(page, served):
    # The browser logs the status of an edit that is refused; the page shows the reason.
    assert [each for each in page.complaints() if "409 (Conflict)" not in each] == []
    own = (f"http://{served.own}/", "data:", "blob:")
    assert all(url.startswith(own) for url in page.requests())


def labels_on_page(page):
    """Track of each detection on the page, by frame and point."""
    return page.run("""(() => {
      const c = asterism.capture;
      const found = [];
      for (let k = 0; k < c.K; k++) for (let r = c.runsOf[k]; r < c.runsOf[k + 1]; r++)
        for (let j = 0; j < c.runLength[r]; j++) found.push([k, c.runFirst[r] + j]);
      return found;
    })()""")


def assert_same_tracks(page, session):
    """Tracks on the page are those of the session."""
    tracks = session.tracks
    order, starts = tracks.by_track
    expected = np.column_stack([tracks.labels[order], tracks.detections.frame_of[order]])
    assert labels_on_page(page) == expected.tolist()
    found = page.run("Array.from(asterism.capture.positions)")
    found = np.reshape(found, (-1, 3))[: len(order)]
    assert np.abs(found - tracks.detections.points[order]).max() < 2e-3
    begins = page.run("Array.from(asterism.capture.starts)")
    # A track that was undone stays on the page, without a detection.
    assert begins == starts.tolist() + [len(order)] * (len(begins) - len(starts))


def test_a_whole_session_by_keyboard(browser, served):
    page = opened(browser, served)
    first = page.run(DECISION)
    assert "Which marker is " in first
    assert "1\n" in first
    n = int(page.run("document.getElementById('uncertain').textContent").split()[-1])
    page.key("n")
    assert n == 1 or page.run(DECISION) != first
    page.key("p")
    assert page.run(DECISION) == first
    page.key("1")  # the decision is right
    on_disk(page, 1)
    assessed(page)
    assert len(edits_of(served)) == 1
    assert page.run(DECISION) != first
    page.key("2")  # the first alternative
    on_disk(page, 2)
    assessed(page)
    assert_same_tracks(page, session_of(served))
    # A track is cut, named, a ghost is deleted, two are joined and exchanged.
    page.run("asterism.seek(120)")
    page.run("document.getElementById('scene').focus()")
    page.key("]")
    page.key("c")
    on_disk(page, 3)
    page.key("i")
    assert page.run("document.activeElement.id") == "edit-name"
    page.run("document.getElementById('edit-name').value = ''")
    for letter in "LKNE":
        page.key(letter)
    page.key("Enter")
    on_disk(page, 4)
    assert page.run("document.activeElement.id") != "edit-name"
    assert "LKNE" in page.run("asterism.capture.header.names")
    page.run("asterism.seek(60)")  # no detection that the cut is about
    page.key("]")
    page.key("k")
    on_disk(page, 5)
    assert [each.kind for each in edits_of(served)][2:] == ["cut", "name", "clutter"]
    assert_same_tracks(page, session_of(served))
    # Undo to the beginning gives the first bytes; redo gives the last ones.
    last = (served.folder / "trial.edits.toml").read_bytes()
    for left in (4, 3, 2, 1, 0):
        page.key("z")
        on_disk(page, left)
    assert edits_of(served) == ()
    assert_same_tracks(page, session_of(served, path="none.toml"))
    for left in (1, 2, 3, 4, 5):
        page.key("y")
        on_disk(page, left)
    assert (served.folder / "trial.edits.toml").read_bytes() == last
    page.key("b")
    page.wait("document.getElementById('edit-saved').textContent.includes('trial.corrected.c3d')")
    assert am.io.read_tracks(served.folder / "trial.corrected.c3d").n_tracks > 40
    page.key("?")
    assert page.run("document.getElementById('keys').open")
    assert "exchange two selected tracks" in page.run("document.getElementById('keys').innerText")
    assert_clean(page, served)
    page.close()


def test_a_whole_session_by_pointer(browser, served):
    page = opened(browser, served, width=1400)
    press(page, ".answers li:nth-child(2) button")
    on_disk(page, 1)
    press(page, "#edit-undo")
    on_disk(page, 0)
    page.run("document.getElementById('release').click(); asterism.seek(100)")
    page.run("document.getElementById('track-subject').click()")
    press(page, "#fit")
    page.settle()
    tracks = session_of(served, path="none.toml").tracks
    there = tracks.labels[tracks.detections.frame_of == 100]
    at = {k: page.run(f"asterism.where({k})") for k in there[there >= 0].tolist()}

    def alone(k):
        return min(np.hypot(*np.subtract(at[k], at[j])) for j in at if j != k)

    one, other = sorted(at, key=alone)[-2:]
    box = page.run("(b => [b.x, b.y])(document.getElementById('scene').getBoundingClientRect())")
    page.click(*np.add(box, at[one]).tolist())
    selected = "document.getElementById('selection').textContent"
    names = tracks.display_names
    assert page.run(selected) == f"Selected: {names[one]}"
    press(page, "#edit-keep")
    page.click(*np.add(box, at[other]).tolist())
    assert page.run(selected) == f"Selected: {names[one]}, {names[other]}"
    press(page, "#edit-swap")
    on_disk(page, 1)
    (edit,) = edits_of(served)
    assert edit.kind == "same"
    assert edit.at[0][0] < 100 <= edit.at[1][0]
    changed = page.run("document.getElementById('changed').innerText")
    assert names[one] in changed
    assert names[other] in changed
    # What changed beside it is refused by its button.
    if page.run("document.querySelector('#changed button') !== null"):
        press(page, "#changed button")
        page.wait(f"{STATE} === '2 edits on disk' || {ERROR} !== ''")
    assert_same_tracks(page, session_of(served))
    assert_clean(page, served)
    page.close()


def test_lasso_selects_what_it_surrounds(browser, served):
    page = opened(browser, served)
    page.key("Escape")
    page.run("asterism.seek(100)")
    press(page, "#edit-lasso")
    assert page.run("document.getElementById('edit-lasso').getAttribute('aria-pressed')") == "true"
    x, y, w, h = page.run("(b => [b.x, b.y, b.width, b.height])"
                          "(document.getElementById('scene').getBoundingClientRect())")  # fmt: skip
    path = [(x + 3, y + 3), (x + w - 3, y + 3), (x + w - 3, y + h - 3), (x + 3, y + h - 3)]
    page.call("Input.dispatchMouseEvent", type="mousePressed", x=path[0][0], y=path[0][1],
              button="left", clickCount=1)  # fmt: skip
    for a, b in path[1:]:
        page.call("Input.dispatchMouseEvent", type="mouseMoved", x=a, y=b, button="left", buttons=1)
    page.call("Input.dispatchMouseEvent", type="mouseReleased", x=path[-1][0], y=path[-1][1],
              button="left", clickCount=1)  # fmt: skip
    assert " more" in page.run("document.getElementById('selection').textContent")
    assert len(page.run("asterism.state().involved")) > 10
    page.close()


def test_a_gap_is_previewed_and_filled(browser, served):
    page = opened(browser, served)
    tracks = session_of(served, path="none.toml").tracks
    gap = max((g for g in tracks.gaps() if g.length < 30), key=lambda g: g.length)
    page.run(f"asterism.choose({gap.track}); asterism.seek({gap.first})")
    page.key("g")
    page.wait(f"document.getElementById('filling').textContent !== '' || {ERROR} !== ''")
    shown = page.run("document.getElementById('filling').innerText")
    assert f"frames {gap.first + 1} to {gap.first + gap.length}" in shown
    assert "standard deviation up to " in shown
    page.key("Enter")
    on_disk(page, 1)
    assert edits_of(served)[0].kind == "fill"
    assert page.run("document.getElementById('filling').textContent") == ""
    page.close()


@pytest.mark.parametrize("preview", [False, True])
def test_a_gap_is_left_open_by_its_key(browser, served, preview):
    page = opened(browser, served)
    tracks = session_of(served, path="none.toml").tracks
    gap = max((g for g in tracks.gaps() if g.length < 30), key=lambda g: g.length)
    page.run(f"asterism.choose({gap.track}); asterism.seek({gap.first})")
    if preview:
        page.key("g")
        page.wait("document.getElementById('filling').innerText.includes('Leave open')")
        assert "⇧G" in page.run("document.getElementById('filling').innerText")
    page.key("g", shift=True)
    on_disk(page, 1)
    (edit,) = edits_of(served)
    assert (edit.kind, edit.at[0][0], edit.at[1][0]) == ("no_fill", gap.first - 1, gap.last + 1)
    assert page.run("document.getElementById('filling').textContent") == ""
    page.key("?")
    assert "leave that gap open" in page.run("document.getElementById('keys').innerText")
    page.close()


def test_different_markers_are_stated_by_keyboard_and_pointer(browser, served):
    page = opened(browser, served)
    tracks = session_of(served, path="none.toml").tracks
    d = tracks.detections
    there = [set(tracks.labels[d.frame_of == t]) for t in (100, 160)]
    one, other = sorted(set.intersection(*there) - {-1})[:2]
    page.key("Escape")
    page.run(f"asterism.seek(100); asterism.choose({one})")
    page.key("j", shift=True)
    assert "Select two tracks, or mark another frame" in page.run(ERROR)
    page.key("e")
    page.run(f"asterism.choose({other})")
    page.key("j", shift=True)
    on_disk(page, 1)
    page.key("Escape")  # the page went to the next decision
    page.run("asterism.seek(100)")
    page.key("h", shift=True)
    page.run(f"asterism.seek(160); asterism.choose({one})")
    press(page, "#edit-apart")
    on_disk(page, 2)
    pressed = "document.getElementById('edit-mark').getAttribute('aria-pressed')"
    assert page.run(pressed) == "false"
    pair, parted = edits_of(served)
    session = session_of(served)
    for edit, before in ((pair, {one, other}), (parted, {one})):
        at = [d.offsets[frame] + point for frame, point in edit.at]
        assert edit.kind == "different"
        assert set(tracks.labels[at]) == before
        assert len(set(session.tracks.labels[at])) == 2
    assert [frame for frame, _ in parted.at] == [100, 160]
    assert_same_tracks(page, session)
    page.key("?")
    assert "they are different markers" in page.run("document.getElementById('keys').innerText")
    page.close()


def test_a_point_of_clutter_is_joined_by_keyboard(browser, served):
    page = opened(browser, served)
    tracks = session_of(served, path="none.toml").tracks
    d = tracks.detections
    frame = int(d.frame_of[np.flatnonzero(tracks.labels < 0)[5]])
    absent = np.setdiff1d(np.arange(tracks.n_tracks), tracks.labels[d.frame_of == frame])
    page.run(f"asterism.seek({frame}); asterism.choose({absent[0]})")
    page.key("e")
    page.key("u")
    assert "point of clutter" in page.run("document.getElementById('selection').textContent")
    page.key("j")
    on_disk(page, 1)
    assert edits_of(served)[0].kind == "same"
    assert_same_tracks(page, session_of(served))
    page.close()


def test_two_tracks_are_exchanged_between_two_frames(browser, served):
    page = opened(browser, served)
    tracks = session_of(served, path="none.toml").tracks
    there = [set(tracks.labels[tracks.detections.frame_of == t]) for t in (100, 104)]
    one, other = sorted(set.intersection(*there) - {-1})[:2]
    page.key("Escape")
    page.run(f"asterism.seek(100); asterism.choose({one})")
    page.key("e")
    page.run(f"asterism.choose({other})")
    page.key("h")  # in this frame alone
    on_disk(page, 1)
    page.key("z")
    on_disk(page, 0)
    pressed = "document.getElementById('edit-mark').getAttribute('aria-pressed')"
    page.run("asterism.seek(100)")  # the page went to the next decision
    page.key("h", shift=True)
    assert page.run(pressed) == "true"
    page.run("asterism.seek(104)")
    page.run(f"asterism.choose({one})")
    page.key("e")
    page.run(f"asterism.choose({other})")
    press(page, "#edit-here")
    on_disk(page, 1)
    assert page.run(pressed) == "false"
    (edit,) = edits_of(served)
    assert (edit.kind, edit.at[1][0], edit.at[2][0]) == ("only", 100, 104)
    changed = np.flatnonzero(session_of(served).tracks.labels != tracks.labels)
    assert set(tracks.detections.frame_of[changed]) <= set(range(100, 105))
    assert_same_tracks(page, session_of(served))
    page.close()


def test_edits_are_previewed_first_where_that_is_wanted(browser, served):
    page = opened(browser, served)
    page.key("q")
    button = "document.getElementById('edit-ahead')"
    assert page.run(f"{button}.getAttribute('aria-pressed')") == "true"
    assert page.run(f"{button}.getAttribute('aria-label')") == "Preview edits before they are made"
    for leave in ("Escape", "Enter"):
        page.key("2")
        page.wait(f"{PREVIEW}.includes('would change')")
        assert edits_of(served) == () if (served.folder / "trial.edits.toml").exists() else True
        page.key(leave)
        page.wait(f"{PREVIEW} === ''")
    on_disk(page, 1)
    assert_same_tracks(page, session_of(served))
    press(page, "#edit-ahead")
    assert page.run(f"{button}.getAttribute('aria-pressed')") == "false"
    page.key("z")
    on_disk(page, 0)
    page.close()


PREVIEW = "document.getElementById('filling').innerText"


def n_previewed(page):
    """Return the number of points that the preview of an assignment would change."""
    return int(page.run(PREVIEW).split("Assigned again, ")[1].split()[0].replace(",", ""))


def test_an_assignment_of_all_points_is_previewed_and_confirmed(browser, by_method):
    page = opened(browser, by_method)
    page.key("t")
    page.wait(f"{PREVIEW}.includes('would change')")
    assert not (by_method.folder / "trial.edits.toml").exists()
    n = n_previewed(page)
    page.key("Escape")
    page.wait(f"{PREVIEW} === ''")
    page.run("document.getElementById('edit-reassign').click()")
    page.wait(f"{PREVIEW}.includes('would change')")
    page.key("Enter")
    on_disk(page, 1)
    assert [each.kind for each in edits_of(by_method)] == ["reassign"]
    session = session_of(by_method, am.GNN())
    assert (session.tracks.labels != session.begun.tracks.labels).sum() == n
    assert_same_tracks(page, session)
    assert "Take back" in page.run("document.getElementById('changed').innerText")
    page.key("r")
    on_disk(page, 2)
    assert_same_tracks(page, session_of(by_method, am.GNN()))
    page.close()


def test_an_assignment_at_even_odds_changes_more(browser, by_method):
    page = opened(browser, by_method)
    n = []
    for shift in (False, True):
        page.key("t", shift=shift)
        page.wait(f"{PREVIEW}.includes('would change')")
        n.append(n_previewed(page))
        page.key("Escape")
        page.wait(f"{PREVIEW} === ''")
    assert n[0] < n[1]
    page.run("document.getElementById('edit-reassign-even').click()")
    page.wait(f"{PREVIEW}.includes('would change')")
    page.key("Enter")
    on_disk(page, 1)
    assert [each.kind for each in edits_of(by_method)] == ["reassign_even"]
    assert_same_tracks(page, session_of(by_method, am.GNN()))
    page.close()


def test_changes_of_a_preview_are_left_out_by_keyboard_and_pointer(browser, by_method):
    page = opened(browser, by_method)
    page.key("t")
    page.wait(f"{PREVIEW}.includes('would change')")
    n = [n_previewed(page)]
    rows = page.run("document.querySelectorAll('.offered > li').length")
    assert rows > 1
    page.key("1")
    n.append(n_previewed(page))
    page.run("document.querySelectorAll('.offered button')[1].click()")
    n.append(n_previewed(page))
    assert n[0] > n[1] > n[2]
    assert page.run("document.querySelectorAll('.offered [aria-pressed=true]').length") == 2
    page.run("document.querySelectorAll('.offered button')[1].click()")
    page.key("Enter")
    on_disk(page, 1)
    (edit,) = edits_of(by_method)
    assert (edit.kind, len(edit.at)) == ("reassign", n[0] - n[1])
    assert_same_tracks(page, session_of(by_method, am.GNN()))
    page.close()


def test_two_tabs_see_the_same(browser, served):
    one, other = opened(browser, served), opened(browser, served)
    one.key("2")
    for page in (one, other):
        on_disk(page, 1)
        assessed(page)
    assert labels_on_page(one) == labels_on_page(other)
    other.key("z")
    for page in (one, other):
        on_disk(page, 0)
    reopened = opened(browser, served)
    assert labels_on_page(one) == labels_on_page(other) == labels_on_page(reopened)
    for page in (one, other, reopened):
        assert_clean(page, served)
        page.close()


def test_errors_are_shown_and_a_lost_server_too(browser, served):
    page = opened(browser, served)
    page.key("Escape")
    page.key("x")
    assert "Select two tracks first" in page.run(ERROR)
    served.stop()
    page.wait(f"{STATE} === 'no connection'")
    page.key("1")
    page.wait(f"{ERROR} !== ''")
    assert "server does not answer" in page.run(ERROR)
    page.close()


@pytest.mark.parametrize("width", [420, 1024])
def test_narrow_screens_hold_all_and_names_are_read(browser, served, width):
    page = opened(browser, served, width=width, height=800, dark=width == 420)
    assert page.run("document.documentElement.scrollWidth") <= width
    unnamed = page.run("""[...document.querySelectorAll('#editor button, #editor input')]
      .filter(e => !(e.getAttribute('aria-label') || e.textContent.trim() || e.labels?.length))
      .map(e => e.id)""")
    assert unnamed == []
    outside = page.run("""[...document.querySelectorAll('#editor button, #editor input')]
      .map(e => [e.id, e.getBoundingClientRect()])
      .filter(([, b]) => b.width && (b.left < 0 || b.right > innerWidth)).map(([id]) => id)""")
    assert outside == []
    for role, name in (("alert", "edit-error"), ("status", "changed"), ("group", "decision")):
        assert page.run(f"document.getElementById('{name}').getAttribute('role')") == role
    press(page, ".answers li:nth-child(2) button")
    on_disk(page, 1)
    page.close()
