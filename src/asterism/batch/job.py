"""One capture of a batch: its files, its settings, and the key by which finished work is known."""

from __future__ import annotations

import dataclasses
import hashlib
import json
from typing import TYPE_CHECKING, Any, Literal

from asterism.batch.run_folder import CONFIG, DECISIONS, SUMMARY
from asterism.batch.storage import read_bytes
from asterism.checks import check_fields, check_kind, check_number
from asterism.errors import ParameterError
from asterism.io import CAPTURE_FORMATS
from asterism.model import TrackingModel
from asterism.model.recipe import versions
from asterism.records import record
from asterism.tracking import method_by_name

if TYPE_CHECKING:
    from collections.abc import Callable

__all__ = ["Job", "Settings", "key_of"]


@record
class Settings:
    """Settings of a batch, the same for all captures.

    Parameters
    ----------
    method : str, optional
        Name of the method; by default each capture selects one.
    options : dict
        Options of the method.
    model : TrackingModel, optional
        Tracking model; by default it is estimated from each capture.
    stitch : bool or "auto"
        Whether tracks are joined through gaps, as for `asterism.track`.
    seed : int
        Seed of the methods that draw random numbers.
    fill : bool
        Whether gaps are filled.
    report : bool
        Whether a page is written for each capture.
    format : str, optional
        Format of the results, a key of `asterism.io.CAPTURE_FORMATS`; by default that of each
        capture.

    Raises
    ------
    ParameterError
        If a value is unknown or has the wrong type.

    Examples
    --------
    >>> import asterism as am
    >>> am.batch.Settings(method="gnn", fill=True)
    Settings(method='gnn', fill=True)
    """

    method: str | None = None
    options: dict[str, Any] = dataclasses.field(default_factory=dict[str, Any])
    model: TrackingModel | None = None
    stitch: bool | Literal["auto"] = "auto"
    seed: int = 0
    fill: bool = False
    report: bool = True
    format: str | None = None

    def __post_init__(self) -> None:
        if self.method is not None:
            method_by_name(self.method, **self.options)
        elif self.options:
            raise ParameterError("options", "a method that has them", "no method")
        if self.model is not None:
            check_kind("model", self.model, TrackingModel, "am.TrackingModel.from_toml(path)")
        if self.stitch not in (True, False, "auto"):
            raise ParameterError("stitch", 'True, False or "auto"', repr(self.stitch))
        check_number("seed", self.seed, above=0, closed=True, integer=True)
        if self.format is not None:
            check_fields("format", [self.format], CAPTURE_FORMATS)

    def to_dict(self) -> dict[str, Any]:
        """Return the settings as plain values."""
        model = None if self.model is None else self.model.to_dict()
        return {
            "method": self.method,
            "options": self.options,
            "model": model,
            "stitch": self.stitch,
            "seed": self.seed,
            "fill": self.fill,
            "report": self.report,
            "format": self.format,
        }


@record
class Job:
    """One capture of a batch.

    Parameters
    ----------
    source : str
        Path or URL of the capture.
    name : str
        Name below the folder of the batch, such as ``subject1/gait.c3d``.
    output : str
        Name of the result below the output folder, such as ``subject1/gait.tracked.c3d``.
    format : str
        Format of the result.
    settings : Settings
        Settings of the batch.
    markers : tuple of str
        Paths or URLs of the marker sets by which the tracks are named.
    edits : str, optional
        Path or URL of the edits that the tracks respect.
    key : str
        SHA-256 of all that determines the result; empty if the input cannot be read.
    """

    source: str
    name: str
    output: str
    format: str
    settings: Settings
    markers: tuple[str, ...] = ()
    edits: str | None = None
    key: str = ""

    @property
    def page(self) -> str | None:
        """Name of the report page; None without one."""
        stem, _, _ = self.output.rpartition(".")
        return f"{stem}.html" if self.settings.report else None

    @property
    def run(self) -> str:
        """Name of the folder of the run."""
        return f"runs/{self.name}"

    @property
    def inputs(self) -> tuple[str, ...]:
        """Places of all files that are read."""
        return (self.source, *self.markers, *(() if self.edits is None else (self.edits,)))

    @property
    def summary(self) -> str:
        """Name of the summary, which is written last and holds the key."""
        return f"{self.run}/{SUMMARY}"

    @property
    def files(self) -> tuple[str, ...]:
        """Names of all files of the result, in the order in which they are written."""
        page = () if self.page is None else (self.page,)
        run = (f"{self.run}/{name}" for name in (CONFIG, *DECISIONS, SUMMARY))
        return (self.output, *page, *run)


def key_of(job: Job, read: Callable[[str], bytes] = read_bytes) -> str:
    """Return the SHA-256 of all that determines a result.

    These are the contents of the files, the settings and the versions.

    Parameters
    ----------
    job : Job
        The capture.
    read : callable
        Function from the place of a file to its content.

    Raises
    ------
    FormatError
        If a file cannot be read.
    """

    def hashed(place: str) -> str:
        return hashlib.sha256(read(place)).hexdigest()

    values = {
        "input": hashed(job.source),
        "markers": [hashed(place) for place in job.markers],
        "edits": None if job.edits is None else hashed(job.edits),
        "settings": job.settings.to_dict(),
        "format": job.format,
        "versions": versions(),
    }
    return hashlib.sha256(json.dumps(values, sort_keys=True).encode()).hexdigest()
