"""Make the report page that the landing page embeds.

MkDocs runs this hook at each build. The capture is simulated, so that the page can be made from
the sources alone; it is written as `live/report.html` of the site and is not part of the sources.
"""

from __future__ import annotations

import functools
import tempfile
from pathlib import Path
from typing import TYPE_CHECKING

from mkdocs.structure.files import File, Files

import asterism as am

if TYPE_CHECKING:
    from mkdocs.config.defaults import MkDocsConfig


@functools.cache
def live_report() -> str:
    """Simulate a walking person, corrupt the capture, track it and return its report page."""
    person = am.simulate.person(activity="walk", frames=240, n_markers=53, seed=1)
    burst = am.simulate.Burst(n=4, shortest=20, longest=50)
    truth = am.simulate.corrupt(person, burst=burst, clutter=0.05, noise=0.0003, seed=1)
    tracks = am.track(truth.detections, stitch=True)
    with tempfile.TemporaryDirectory() as folder:
        page = Path(folder) / "report.html"
        am.report(tracks, page, truth=truth, title="A simulated walk, 53 markers")
        return page.read_text(encoding="utf-8")


def on_files(files: Files, /, *, config: MkDocsConfig) -> Files:
    """Add the report page to the files of the site."""
    files.append(File.generated(config, "live/report.html", content=live_report()))
    return files
