"""Make the pictures of the editor: ``python docs/make_edit_pictures.py CAPTURES``.

CAPTURES is a folder with real captures; Chromium draws. Beside the pictures nothing is kept.
"""

from __future__ import annotations

import io
import json
import subprocess
import sys
from pathlib import Path

from PIL import Image

import asterism as am

sys.path.insert(0, str(Path(__file__).parents[1] / "tests" / "reporting"))
from browser import Browser, Page

IMAGES = Path(__file__).parent / "images"
STATE = "document.getElementById('edit-state').textContent"


def photograph(page: Page, name: str) -> None:
    """Save what is on a page."""
    page.settle()
    page.settle()
    picture = Image.open(io.BytesIO(page.screenshot())).convert("RGB")
    picture.quantize(256).save(IMAGES / f"edit_{name}.png", optimize=True)


def session(browser: Browser, address: str) -> None:
    """Correct a capture, and photograph each step."""
    page = browser.page(address, width=1240, height=860)
    page.wait("document.querySelector('.question') !== null")
    photograph(page, "decision")
    page.key("2")
    page.wait(f"{STATE} === '1 edit on disk' && document.querySelector('.question') !== null")
    page.wait("!document.getElementById('uncertain').textContent.includes('…')")
    photograph(page, "changed")
    gap = page.run("""(() => {
      const c = asterism.capture;
      for (const min of [20, 10, 4]) {
        for (const k of c.trouble) {
          for (let r = c.runsOf[k]; r + 1 < c.runsOf[k + 1]; r++) {
            const end = c.runFirst[r] + c.runLength[r];
            const n = c.runFirst[r + 1] - end;
            if (n >= min && n < 40 && c.runLength[r] > 20) return [k, end + 1];
          }
        }
      }
    })()""")
    page.run(f"asterism.choose({gap[0]}); asterism.seek({gap[1]})")
    page.run("document.querySelector('#trails').value = '0'")
    page.key("g")
    page.wait("document.getElementById('filling').textContent !== ''")
    page.run("document.getElementById('filling').scrollIntoView({block: 'end'})")
    for _ in range(9):
        page.key("+")
    photograph(page, "fill")
    page.close()
    page = browser.page(address, width=420, height=860, dark=True, scale=1.5)
    page.wait("document.querySelector('.question') !== null")
    page.run("document.getElementById('editor').scrollIntoView({block: 'end'})")
    photograph(page, "narrow")
    page.close()


def main(captures: Path) -> None:
    """Corrupt a capture of two tennis players, serve it, and photograph the editor."""
    browser = Browser()
    folder = Path(browser.profile)
    labelled = am.read(next(captures.rglob("kinematics_tennis_serve_2players.c3d"))).tracks
    truth = am.simulate.corrupt(labelled, missing=0.2, missing_run=25, clutter=0.02, seed=1)
    am.write(truth.detections, folder / "serve.c3d")
    am.learn_marker_set(labelled).to_toml(folder / "players.toml")
    line = "edit serve.c3d --markers players.toml --no-browser --json"
    served = subprocess.Popen(
        [Path(sys.executable).with_name("asterism"), *line.split()],
        cwd=folder, stdout=subprocess.PIPE, text=True,
    )  # fmt: skip
    try:
        assert served.stdout is not None
        text = ""
        while not text.endswith("}\n"):
            text += served.stdout.readline()
        session(browser, json.loads(text)["address"])
    finally:
        served.terminate()
        served.wait()
        browser.close()


if __name__ == "__main__":
    main(Path(sys.argv[1]))
