"""Make the pictures of the report page: ``python docs/make_report_pictures.py CAPTURES``.

CAPTURES is a folder with real captures; Chromium draws. Beside the pictures nothing is kept.
"""

from __future__ import annotations

import io
import sys
from pathlib import Path
from typing import Any

from PIL import Image

import asterism as am

sys.path.insert(0, str(Path(__file__).parents[1] / "tests" / "reporting"))
from browser import Browser

IMAGES = Path(__file__).parent / "images"


def draw(browser: Browser, name: str, act: str, **look: Any) -> None:
    """Photograph a page.

    Parameters
    ----------
    browser : Browser
    name : str
        Of the page in the browser's folder and of the picture.
    act : str
        JavaScript that brings the page to what is to be seen.
    **look
        Of the window, as for `Browser.page`.
    """
    page = browser.page(Path(browser.profile) / f"{name}.html", **look)
    page.run(act)
    page.settle()
    page.settle()
    picture = Image.open(io.BytesIO(page.screenshot())).convert("RGB")
    picture.save(IMAGES / f"report_{name}.png", optimize=True)
    page.close()


def main(captures: Path) -> None:
    """Track three captures and two scenes, and photograph their reports."""
    IMAGES.mkdir(exist_ok=True)
    browser = Browser()
    try:
        pages = Path(browser.profile)
        _captures(captures, pages)
        _scenes(pages)
        draw(browser, "tennis", "asterism.seek(196)", width=1240, height=860)
        away = "for (let n = 0; n < 9; n++) dispatchEvent(new KeyboardEvent('keydown', {key: '-'}))"
        draw(
            browser, "walking", f"asterism.seek(800); asterism.choose(12); {away}", width=1240,
            height=860, dark=True,
        )  # fmt: skip
        draw(browser, "rat", "asterism.seek(900)", width=1240, height=860)
        draw(
            browser, "person", "dispatchEvent(new KeyboardEvent('keydown', {key: 'n'}))",
            width=1240, height=860,
        )  # fmt: skip
        draw(browser, "crossing", "asterism.seek(20)", width=375, height=860, dark=True, scale=1.5)
    finally:
        browser.close()


def _captures(captures: Path, pages: Path) -> None:
    def found(name: str) -> Path:
        return next(captures.rglob(name))

    tennis = am.read(found("kinematics_tennis_serve_2players.c3d"))
    am.report(am.track(tennis, stitch=True), pages / "tennis.html")
    walking = am.read(found("walking_1.c3d"))
    rig = am.read_rig(found("walking_1.xcp"))
    am.report(am.track(walking, am.JPDA()), pages / "walking.html", rig=rig)
    rat = am.read(found("runway_13.c3d"))
    am.report(am.track(rat, am.JPDA()), pages / "rat.html", truth=rat.tracks)


def _scenes(pages: Path) -> None:
    person = am.simulate.person(frames=400, seed=2)
    truth = am.simulate.corrupt(person, missing=0.1, clutter=0.1, noise=0.001, seed=2)
    tracks = am.track(truth.detections, am.GNN())
    am.report(tracks, pages / "person.html", truth=truth, title="A person, corrupted")
    crossing = am.simulate.crossing(seed=3, rate=100)
    truth = am.simulate.corrupt(crossing, missing=0.1, clutter=0.1, noise=0.002, seed=4)
    tracks = am.track(truth.detections, am.JPDA())
    am.report(tracks, pages / "crossing.html", truth=truth, title="Two cubes")


if __name__ == "__main__":
    main(Path(sys.argv[1]))
