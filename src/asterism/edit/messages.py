"""Messages of the editor page: plain JSON, checked field by field before anything is done."""

from __future__ import annotations

import json
from typing import Any, get_args

from asterism.errors import ParameterError
from asterism.model.edit import REASSIGN, EditKind

__all__ = ["Message", "parsed"]

Message = dict[str, Any]
_NUMBER, _TEXT, _NUMBERS, _CHOICE = "a whole number", "a text", "a list of numbers", "a number"
_GROUPS, _FLAG = "a list of groups", "true or false"
_FIELDS: dict[str, dict[str, str]] = {
    "edit": {"kind": _TEXT, "detections": _NUMBERS, "name": _TEXT},
    "fill": {"kind": _TEXT, "track": _NUMBER, "first": _NUMBER, "last": _NUMBER},
    "preview": {"track": _NUMBER, "first": _NUMBER, "last": _NUMBER},
    "preview_reassign": {"is_even": _FLAG},
    "preview_edit": {"kind": _TEXT, "detections": _NUMBERS, "name": _TEXT},
    "preview_choose": {"assessment": _NUMBER, "decision": _NUMBER, "alternative": _CHOICE},
    "reassign": {"version": _NUMBER, "without": _GROUPS},
    "choose": {"assessment": _NUMBER, "decision": _NUMBER, "alternative": _CHOICE},
    "refuse": {"version": _NUMBER, "stretch": _NUMBER},
    "undo": {},
    "redo": {},
    "save": {},
}
_FILLS = ("fill", "no_fill")
_STATED = tuple(kind for kind in get_args(EditKind) if kind not in (*_FILLS, *REASSIGN))
_KINDS = {"edit": _STATED, "preview_edit": _STATED, "fill": _FILLS}
_MAX_TEXT = 200
_MAX_DETECTIONS = 3
_MAX_GROUPS = 1000


def parsed(action: str, body: bytes) -> Message:
    """Parse the message of an action.

    Parameters
    ----------
    action : str
        Name of the action.
    body : bytes
        JSON.

    Returns
    -------
    dict
        Values by name, each of its type.

    Raises
    ------
    ParameterError
        If the action is unknown, the body is no JSON object, or a field is missing, unknown or of
        another type.

    Examples
    --------
    >>> parsed("preview", b'{"track": 3, "first": 10, "last": 14}')
    {'track': 3, 'first': 10, 'last': 14}
    >>> parsed("undo", b"[]")
    Traceback (most recent call last):
    ...
    asterism.errors.ParameterError: message: expected a JSON object, found list
    """
    if action not in _FIELDS:
        raise ParameterError("action", " or ".join(_FIELDS), repr(action[:40]))
    try:
        values: Any = json.loads(body)
    except (ValueError, RecursionError):
        raise ParameterError("message", "JSON", "something else") from None
    if not isinstance(values, dict):
        raise ParameterError("message", "a JSON object", type(values).__name__)
    fields = _FIELDS[action]
    if set(values) != set(fields):
        found = ", ".join(sorted(str(key)[:40] for key in values)) or "none"
        raise ParameterError("message", f"the fields {', '.join(fields) or 'none'}", found)
    for name, kind in fields.items():
        if not _is(values[name], kind):
            raise ParameterError(name, kind, repr(values[name])[:60])
    if "kind" in fields and values["kind"] not in (known := _KINDS[action]):
        raise ParameterError("kind", " or ".join(known), repr(values["kind"])[:60])
    return values


def _is(value: Any, kind: str) -> bool:
    if kind == _TEXT:
        return isinstance(value, str) and len(value) <= _MAX_TEXT
    if kind == _FLAG:
        return isinstance(value, bool)
    if kind == _NUMBERS:
        return (
            isinstance(value, list)
            and 1 <= len(value) <= _MAX_DETECTIONS
            and all(_is(each, _NUMBER) for each in value)
        )
    if kind == _GROUPS:
        return (
            isinstance(value, list)
            and len(value) <= _MAX_GROUPS
            and all(_is(each, _NUMBER) for each in value)
        )
    return (kind == _CHOICE and value is None) or (type(value) is int and 0 <= value < 2**53)
