"""Make the report page that the landing page embeds.

MkDocs runs this hook at each build. The page shows a real capture where it lies beside the project
(``../shared/data``), and a simulated walk otherwise; the landing page states which. It is written
as `live/report.html` of the site and is not part of the sources.
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
    from mkdocs.structure.pages import Page

_TURN = "mcgillmotionlab__biomechzoo/data/sample_study/raw c3d files/HC030A/Turn/HC030A22.c3d"
_CAPTURE = Path(__file__).resolve().parents[3] / "shared" / "data" / _TURN
_REAL = (
    "The capture is real: a person who turns while walking, recorded with Vicon at 100 Hz "
    "(HC030A22.c3d of biomechZoo, McGill Motion Laboratory, MIT licence)."
)
_SIMULATED = "The capture is simulated: a walking person with 53 markers at 100 Hz."
_PLACE = "<!-- which capture -->"


@functools.cache
def live_report() -> tuple[str, str]:
    """Corrupt the capture, track it, and return its report page and a sentence on its origin."""
    if _CAPTURE.exists():
        source, origin, title = am.read(_CAPTURE).tracks, _REAL, "A turning step, HC030A22.c3d"
    else:
        source = am.simulate.person(activity="walk", frames=240, n_markers=53, seed=1)
        origin, title = _SIMULATED, "A simulated walk, 53 markers"
    burst = am.simulate.Burst(n=4, shortest=20, longest=50)
    truth = am.simulate.corrupt(source, burst=burst, clutter=0.05, noise=0.0003, seed=1)
    tracks = am.track(truth.detections, stitch=True)
    with tempfile.TemporaryDirectory() as folder:
        page = Path(folder) / "report.html"
        am.report(tracks, page, truth=truth, title=title)
        return page.read_text(encoding="utf-8"), origin


def on_files(files: Files, /, *, config: MkDocsConfig) -> Files:
    """Add the report page to the files of the site."""
    files.append(File.generated(config, "live/report.html", content=live_report()[0]))
    return files


def on_page_markdown(
    markdown: str, /, *, page: Page, config: MkDocsConfig, files: Files
) -> str | None:
    """State on the landing page which capture the report shows."""
    if page.file.src_uri != "index.md":
        return None
    if _PLACE not in markdown:
        raise ValueError(f"docs/index.md: expected the mark {_PLACE}, found none")
    return markdown.replace(_PLACE, live_report()[1])
