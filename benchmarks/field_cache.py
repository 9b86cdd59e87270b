"""Answers of `field.py` that are kept, so that a long run can be stopped and gone on with."""

from __future__ import annotations

import hashlib
import json
from typing import TYPE_CHECKING, Any

if TYPE_CHECKING:
    from collections.abc import Callable
    from pathlib import Path

__all__ = ["Cache", "digest"]


class Cache:
    """Answers kept by all that they depend on, a line of JSON each.

    Nothing is made where it is closed: `get` raises `KeyError` at what is not known.
    """

    def __init__(self, path: Path, *, is_closed: bool) -> None:
        self.is_closed = is_closed
        path.parent.mkdir(exist_ok=True)
        self.path = path
        lines = path.read_text().splitlines() if path.exists() else []
        self.known: dict[str, Any] = {}
        for line in lines:
            entry = json.loads(line)
            self.known[entry["key"]] = entry["value"]

    def get(self, key: tuple[Any, ...], make: Callable[[], Any]) -> Any:
        """Give what is known, or make it and keep it."""
        text = json.dumps(key)
        if text not in self.known:
            if self.is_closed:
                raise KeyError(text)
            self.known[text] = make()
            with self.path.open("a") as file:
                file.write(json.dumps({"key": text, "value": self.known[text]}) + "\n")
        return self.known[text]


def digest(*paths: Path) -> str:
    """Give a word for the bytes of files."""
    found = hashlib.sha256()
    for path in paths:
        found.update(path.read_bytes())
    return found.hexdigest()[:12]
