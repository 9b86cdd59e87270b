"""Make the pictures of batches and sweeps: ``python docs/make_batch_pictures.py CAPTURES``.

CAPTURES is a folder with real captures; Chromium draws. The study is that of the guide.
"""

from __future__ import annotations

import os
import re
import shutil
import subprocess
import sys
import tempfile
from pathlib import Path

from PIL import Image

import asterism as am

sys.path.insert(0, str(Path(__file__).parents[1] / "tests" / "reporting"))
from browser import CHROMIUM

DOCS = Path(__file__).resolve().parent
NAMES = ("walking_1.c3d", "PronetoRun01.c3d", "mocap36.c3d", "HC030A22.c3d")


def write_captures(data: Path, folder: Path) -> None:
    """Write real captures in bursts of occlusions, without their names, and a damaged one."""
    burst = am.simulate.Burst(n=5, shortest=5, longest=60)
    for path in sorted(data.rglob("*.c3d")):
        if path.name in NAMES:
            truth = am.simulate.corrupt(
                am.read(path).tracks, burst=burst, missing=0.05, clutter=0.05, noise=3e-4, seed=1
            )
            am.write(truth.detections, folder / path.name)
    (folder / "damaged.c3d").write_bytes(b"\x02\x50" + b"junk" * 200)


def photograph(page: Path, picture: Path) -> None:
    """Save what Chromium shows of a page without scripts."""
    options = ("--headless", "--no-sandbox", "--hide-scrollbars", "--window-size=1000,330")
    shot = page.with_suffix(".png")
    subprocess.run([CHROMIUM, *options, f"--screenshot={shot}", page.as_uri()], check=True)
    Image.open(shot).convert("RGB").save(picture, optimize=True)


def main() -> None:
    """Make both pictures."""
    data = Path(sys.argv[1]).resolve()
    with tempfile.TemporaryDirectory() as name:
        folder = Path(name)
        (folder / "captures").mkdir()
        write_captures(data, folder / "captures")
        os.chdir(folder)  # the page shows the paths as they are given
        am.batch.run(["captures"], "tracked")
        photograph(folder / "tracked" / "index.html", DOCS / "images" / "batch_index.png")
        guide = (DOCS / "guides" / "sweep.md").read_text(encoding="utf-8")
        found = re.search(r"```toml\n(.*?)```", guide, re.DOTALL)
        assert found is not None
        (folder / "study.toml").write_text(found[1], encoding="utf-8")
        am.sweep.run(am.sweep.read_study(folder / "study.toml"), folder / "results")
        shutil.copy(folder / "results" / "figure.svg", DOCS / "images" / "sweep.svg")


if __name__ == "__main__":
    main()
