"""The report page with an editor, without a server: edits are collected and downloaded."""

from __future__ import annotations

import numpy as np
import pytest

import asterism as am
from asterism.cli import main
from asterism.reporting.page.head import bundled
from tests.edit.served import CAPTURE, write_capture
from tests.reporting.browser import CHROMIUM

pytestmark = pytest.mark.skipif(CHROMIUM is None, reason="needs Chromium: apt-get install chromium")

KEEP_DOWNLOADS = """
  const made = URL.createObjectURL;
  URL.createObjectURL = (blob) => {
    blob.text().then((text) => { globalThis.downloaded = text; });
    return made.call(URL, blob);
  };
"""


@pytest.fixture(scope="module")
def tracks(tmp_path_factory):
    """Tracks of the capture by GNN."""
    folder = tmp_path_factory.mktemp("tracks")
    write_capture(folder)
    return am.track(am.read(folder / CAPTURE), am.GNN())


def test_collected_edits_are_those_of_the_capture(browser, folder, monkeypatch):
    monkeypatch.chdir(folder)
    assert main(["track", CAPTURE, "--method", "gnn", "-o", "tracked.csv", "-q"]) == 0
    assert main(["report", "tracked.csv", "--editor", "-q"]) == 0
    page = browser.page(folder / "tracked.html", before=KEEP_DOWNLOADS)
    state = "document.getElementById('edit-state').textContent"
    page.run("asterism.seek(100); asterism.choose(3)")
    page.key("k")
    page.wait(f"{state} === '1 edit in this page'")
    page.run("asterism.choose(5)")
    page.key("c")
    page.wait(f"{state} === '2 edits in this page'")
    page.key("z")
    page.wait(f"{state} === '1 edit in this page'")
    page.run("document.getElementById('edit-name').value = 'C7 \"a\"'")
    page.run("document.getElementById('edit-give').click()")
    page.wait(f"{state} === '2 edits in this page'")
    page.key("b")
    page.wait("globalThis.downloaded !== undefined")
    text = page.run("downloaded")
    (folder / "tracked.edits.toml").write_text(text)
    capture = am.read(folder / "tracked.csv")
    ghost, name = am.io.read_edits(folder / "tracked.edits.toml", capture)
    labels = am.io.read_tracks(folder / "tracked.csv").labels
    for edit, kind, track in ((ghost, "clutter", 3), (name, "name", 5)):
        ((frame, point),) = edit.at
        assert edit.kind == kind
        assert labels[capture.offsets[frame] + point] == track
    assert name.name == 'C7 "a"'
    assert np.abs(ghost.at[0][0] - 100) < 20
    assert page.complaints() == []
    assert all(url.startswith(("file:", "blob:")) for url in page.requests())
    page.close()
    # They are respected by the tracking of the same file.
    line = "track tracked.csv --method gnn --edits tracked.edits.toml -o again.csv -q"
    assert main(line.split()) == 0
    again = am.io.read_tracks(folder / "again.csv")
    assert again.names[again.labels[capture.offsets[name.at[0][0]] + name.at[0][1]]] == 'C7 "a"'


def test_a_track_is_not_cut_where_the_page_hides_frames(browser, tracks, tmp_path, monkeypatch):
    monkeypatch.setattr(
        "asterism.reporting.page.thinning.MOST_POINTS", tracks.detections.n_points // 2
    )
    am.report(tracks, tmp_path / "thinned.html", editor=True)
    page = browser.page(tmp_path / "thinned.html")
    state, error = (f"document.getElementById('edit-{name}').textContent"
                    for name in ("state", "error"))  # fmt: skip
    page.run("asterism.seek(20); asterism.choose(3)")
    page.key("c")
    page.wait(f"{error}.includes('Frames in between are not on this page')")
    assert page.run(state) == "0 edits in this page"
    page.key("k")
    page.wait(f"{state} === '1 edit in this page'")
    page.close()


def test_pages_without_an_editor_carry_none_of_it(tracks, tmp_path):
    am.report(tracks, tmp_path / "plain.html")
    am.report(tracks, tmp_path / "editor.html", editor=True)
    plain, editor = ((tmp_path / f"{name}.html").read_bytes() for name in ("plain", "editor"))
    assert b"edit-swap" not in plain
    script = bundled("editor.js").encode()
    assert script in editor
    assert script not in plain
    assert b"connect-src" not in plain  # so its policy, none by default, lets it send nothing
    assert len(editor) < len(plain) + 100_000
