"""Folder of a run, with everything that repeats it bit for bit.

``run.toml`` holds the recipe and the path of the input, ``log.txt`` the log messages,
``decisions.csv`` and ``decisions.json`` the decisions, and ``summary.json`` the figures; the result
is beside them. ``summary.json`` is written last, so its
presence shows that the run is complete.
"""

from __future__ import annotations

import logging
from contextlib import contextmanager
from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING, Any, Self, cast

from asterism.batch.storage import is_url
from asterism.checks import check_fields
from asterism.errors import FormatError, ParameterError
from asterism.io import CAPTURE_FORMATS
from asterism.io.atomic import write_text
from asterism.model import Recipe
from asterism.model.toml_file import read_toml, write_toml
from asterism.tracking import method_by_name

if TYPE_CHECKING:
    from collections.abc import Generator

__all__ = ["CONFIG", "DECISIONS", "FILES", "LOG", "SUMMARY", "Run", "writing_log"]

CONFIG, LOG, SUMMARY = "run.toml", "log.txt", "summary.json"
DECISIONS = "decisions.csv", "decisions.json"
FILES = CONFIG, LOG, *DECISIONS, SUMMARY


@dataclass(frozen=True, kw_only=True)
class Run:
    """A recipe with its input and the format of its result.

    Parameters
    ----------
    recipe : Recipe
        Model, method, options and seed.
    source : str
        Path of the capture, or its URL.
    format : str
        Format of the result, a key of `asterism.io.CAPTURE_FORMATS`.
    markers : tuple of str
        Marker sets by which the tracks are named.
    edits : tuple of str
        Files of the edits that the tracks respect.
    """

    recipe: Recipe
    source: str
    format: str
    markers: tuple[str, ...] = ()
    edits: tuple[str, ...] = ()

    def write(self, path: Path) -> None:
        """Write the run as ``run.toml``."""
        values = self.recipe.to_dict()
        values["input"] = {"path": _absolute(self.source), **values["input"]}
        values["names"] = {
            "paths": [_absolute(path) for path in self.markers],
            "edit_paths": [_absolute(path) for path in self.edits],
            **values["names"],
        }
        write_text(path, write_toml({**values, "output": {"format": self.format}}, None))

    @classmethod
    def read(cls, path: Path) -> Self:
        """Read a ``run.toml``.

        Raises
        ------
        FormatError
            If the file does not exist, or `write` did not write it.
        """
        values = read_toml(path, "a run.toml")
        try:
            names = ("input", "output", "method", "names", "model", "versions")
            check_fields("run", values, names)
            for name in names:
                if not isinstance(values.get(name), dict):
                    raise ParameterError(name, "a table", repr(values.get(name)))
            source, format = values["input"].get("path"), values.pop("output").get("format")
            for name, text in (("input.path", source), ("output.format", format)):
                if not isinstance(text, str):
                    raise ParameterError(name, "a text", repr(text))
            markers, edits = (values["names"].pop(key, []) for key in ("paths", "edit_paths"))
            for name, paths in (("names.paths", markers), ("names.edit_paths", edits)):
                if not isinstance(paths, list):
                    raise ParameterError(name, "a list of files", repr(paths))
            check_fields("output.format", [format], CAPTURE_FORMATS)
            recipe = Recipe.from_dict(values)
            method_by_name(recipe.method, **recipe.options)
        except ParameterError as error:
            raise FormatError(path, error.name, error.expected, error.got, error.hint) from error
        sets, edited = (tuple(map(str, cast("list[Any]", paths))) for paths in (markers, edits))
        return cls(recipe=recipe, source=source, format=format, markers=sets, edits=edited)


def _absolute(place: str) -> str:
    return place if is_url(place) else str(Path(place).resolve())


@contextmanager
def writing_log(folder: Path) -> Generator[None, None, None]:
    """Write the log messages to the log of a folder while the block runs."""
    handler = logging.FileHandler(folder / LOG, mode="w", encoding="utf-8")
    handler.setFormatter(logging.Formatter("%(asctime)s %(levelname)s %(message)s"))
    logger = logging.getLogger("asterism")
    level = logger.level
    logger.setLevel(logging.INFO)
    logger.addHandler(handler)
    try:
        yield
    except BaseException as end:
        # Only this file gets the line; the end of the program decides about stderr.
        text = f"ended by {type(end).__name__}: {end}"
        handler.handle(logging.makeLogRecord({"levelname": "ERROR", "msg": text}))
        raise
    finally:
        logger.removeHandler(handler)
        logger.setLevel(level)
        handler.close()
