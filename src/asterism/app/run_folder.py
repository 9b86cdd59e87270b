"""A run and its folder: everything that is needed to repeat a tracking bit for bit.

``run.toml`` holds the resolved configuration, ``log.txt`` the news, ``summary.json`` the figures,
and the result lies beside them. ``summary.json`` is written last: where it is, the run is complete.
"""

from __future__ import annotations

import hashlib
import logging
import platform
import tomllib
from contextlib import contextmanager
from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING, Any, Self

import asterism as am
from asterism.errors import FormatError, ParameterError, check_fields, check_number, not_read
from asterism.io.atomic import replacing

if TYPE_CHECKING:
    from collections.abc import Generator

__all__ = [
    "CONFIG",
    "FILES",
    "LOG",
    "SUMMARY",
    "Job",
    "sha256_of",
    "write_text",
    "writing_log",
]

log = logging.getLogger(__name__)

FILES = CONFIG, LOG, SUMMARY = "run.toml", "log.txt", "summary.json"


NONE = "none"
"""How an option that is None is written, here as on the command line."""


@dataclass(frozen=True, kw_only=True)
class Job:
    """A tracking with everything decided.

    Parameters
    ----------
    source : Path
        The capture.
    sha256 : str
        Its hash.
    method : str
        Name of the method.
    options : dict
        All its options.
    model : TrackingModel
        The model.
    seed : int
        For the methods that draw.
    start : bool
        Whether to begin with the tracks that the capture carries.
    stitch : bool
        Whether tracks are made into markers through gaps of any length.
    format : str
        Format of the result, a key of `asterism.io.FORMATS`.
    chosen : str
        Which method the capture chose and why; "" where it was named.
    """

    source: Path
    sha256: str
    method: str
    options: dict[str, Any]
    model: am.TrackingModel
    seed: int
    start: bool
    stitch: bool
    format: str
    chosen: str = ""

    def to_toml(self) -> str:
        """Give the job as the text of a ``run.toml``, with the versions of what runs it."""
        import tomli_w

        return tomli_w.dumps(
            {
                "input": {"path": str(self.source.resolve()), "sha256": self.sha256},
                "output": {"format": self.format},
                "method": {
                    "name": self.method,
                    "seed": self.seed,
                    "start": self.start,
                    "stitch": self.stitch,
                    # For people: a repeat does not choose again.
                    **({"chosen": self.chosen} if self.chosen else {}),
                    # TOML has no null.
                    "options": {k: NONE if v is None else v for k, v in self.options.items()},
                },
                "model": self.model.to_dict(),
                "versions": versions(),
            }
        )

    @classmethod
    def from_toml(cls, path: Path) -> Self:
        """Read a ``run.toml``.

        Raises
        ------
        FormatError
            If the file is not there, or not what `to_toml` writes.
        """
        try:
            values = tomllib.loads(path.read_text(encoding="utf-8"))
        except OSError as error:
            raise not_read(path, error) from error
        except (UnicodeDecodeError, tomllib.TOMLDecodeError) as error:
            raise FormatError(path, "the file", "TOML", str(error)) from error
        try:
            check_fields("run", values, ("input", "output", "method", "model", "versions"))
            job = cls(
                source=Path(_text(values, "input", "path")),
                sha256=_text(values, "input", "sha256"),
                method=_text(values, "method", "name"),
                options={
                    k: None if v == NONE else v
                    for k, v in _table(_table(values, "method"), "options").items()
                },
                start=_table(values, "method").get("start", False) is True,
                stitch=_table(values, "method").get("stitch", False) is True,
                chosen=_text(values, "method", "chosen", default=""),
                model=am.TrackingModel.from_dict(_table(values, "model")),
                seed=_table(values, "method").get("seed", 0),
                format=_text(values, "output", "format"),
            )
            am.method_by_name(job.method, **job.options)
            check_number("method.seed", job.seed, above=0, closed=True, integer=True)
            check_fields("output.format", [job.format], am.FORMATS)
        except ParameterError as error:
            raise FormatError(path, error.name, error.expected, error.got, error.hint) from error
        for name, version in versions().items():
            before = _table(values, "versions").get(name)
            if before != version:
                log.warning("%s: made with %s %s, this is %s", path, name, before, version)
        return job


def versions() -> dict[str, str]:
    """Give the versions on which a result may depend."""
    import numpy
    import scipy

    return {
        "asterism": am.__version__,
        "python": platform.python_version(),
        "numpy": numpy.__version__,
        "scipy": scipy.__version__,
        "platform": platform.platform(),
    }


def sha256_of(path: Path) -> str:
    """Give the SHA-256 of a file in hexadecimal.

    Raises
    ------
    FormatError
        If it cannot be read.
    """
    try:
        with path.open("rb") as file:
            return hashlib.file_digest(file, "sha256").hexdigest()
    except OSError as error:
        raise not_read(path, error) from error


def write_text(path: Path, text: str) -> None:
    """Write a text file as a whole or not at all."""
    with replacing(path) as file:
        file.write(text.encode())


@contextmanager
def writing_log(folder: Path) -> Generator[None, None, None]:
    """Write the program's news to the log of a folder while the block runs."""
    handler = logging.FileHandler(folder / LOG, mode="w", encoding="utf-8")
    handler.setFormatter(logging.Formatter("%(asctime)s %(levelname)s %(message)s"))
    logger = logging.getLogger("asterism")
    level = logger.level
    logger.setLevel(logging.INFO)
    logger.addHandler(handler)
    try:
        yield
    except BaseException as end:
        # To this file alone: what else hears of it is decided where the program ends.
        text = f"ended by {type(end).__name__}: {end}"
        handler.handle(logging.makeLogRecord({"levelname": "ERROR", "msg": text}))
        raise
    finally:
        logger.removeHandler(handler)
        logger.setLevel(level)
        handler.close()


def _table(values: dict[str, Any], name: str) -> dict[str, Any]:
    table = values.get(name)
    if not isinstance(table, dict):
        raise ParameterError(name, "a table", repr(table))
    return table


def _text(values: dict[str, Any], table: str, name: str, default: str | None = None) -> str:
    text = _table(values, table).get(name, default)
    if not isinstance(text, str):
        raise ParameterError(f"{table}.{name}", "a text", repr(text))
    return text
