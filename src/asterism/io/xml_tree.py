"""XML of calibrations and marker sets, from files that may be damaged or malicious."""

from __future__ import annotations

from typing import TYPE_CHECKING
from xml.etree import ElementTree

from asterism.errors import FormatError
from asterism.io.whole_file import read_bytes

if TYPE_CHECKING:
    from pathlib import Path

__all__ = ["load", "to_bytes"]

_DEEPEST = 64  # levels; real files have at most 24
_PIECE = 1 << 16  # bytes parsed at a time


class _Forbidden(Exception):
    """The file has a structure that no real file has."""


class _CarefulBuilder(ElementTree.TreeBuilder):
    def __init__(self) -> None:
        super().__init__()
        self.depth = 0

    def start(self, tag: str, attrs: dict[str, str], /) -> ElementTree.Element:
        self.depth += 1
        if self.depth > _DEEPEST:
            raise _Forbidden(f"more than {_DEEPEST} levels of elements")
        return super().start(tag, attrs)

    def end(self, tag: str, /) -> ElementTree.Element:
        self.depth -= 1
        return super().end(tag)

    def doctype(self, name: str, pubid: str | None, system: str | None) -> None:
        # Entities, which may refer to other files or grow without end, are declared there.
        raise _Forbidden("a document type declaration")


def load(path: Path, root: str) -> ElementTree.Element:
    """Read an XML file.

    Parameters
    ----------
    path : Path
        XML file of at most 64 MB.
    root : str
        Required name of the outermost element.

    Returns
    -------
    Element
        Outermost element.

    Raises
    ------
    FormatError
        If the file is not XML, has another outermost element, declares a document type, or nests
        its elements more than 64 levels deep.
    """
    raw = read_bytes(path)
    parser = ElementTree.XMLParser(target=_CarefulBuilder())
    try:
        for start in range(0, len(raw), _PIECE):
            parser.feed(raw[start : start + _PIECE])
        tree = parser.close()
    except ElementTree.ParseError as error:
        line, column = error.position
        place = f"line {line}, column {column + 1}"
        raise FormatError(path, place, "XML", str(error)) from error
    except _Forbidden as error:
        raise FormatError(path, "its structure", "elements alone", str(error)) from error
    except (LookupError, ValueError) as error:
        raise FormatError(path, "its encoding", "one that XML knows", str(error)) from error
    if tree.tag != root:
        raise FormatError(path, "the outermost element", f"<{root}>", f"<{tree.tag[:60]}>")
    return tree


def to_bytes(root: ElementTree.Element) -> bytes:
    """Encode an element with its descendants as the bytes of an XML file."""
    ElementTree.indent(root)
    return ElementTree.tostring(root, encoding="utf-8", xml_declaration=True) + b"\n"
