"""Classification of channel names: named markers, unnamed points and computed channels.

Recording systems have their own names for unnamed points. Plug-in-Gait and similar models store
joint centres, segment axes, angles and forces as points; these are not measured.
"""

from __future__ import annotations

import re
from typing import TYPE_CHECKING

if TYPE_CHECKING:
    from collections.abc import Iterable, Mapping, Sequence

__all__ = ["find_modelled", "is_unlabelled"]

# Vicon *12; Qualisys leaves the name empty; Motive Unlabeled 7, U_7; others 0001, New 0001, uname7.
_UNLABELLED = re.compile(
    r"|\*\d*|unlabell?ed\b.*|unlabell?ed[_\d].*|u_\d+|\d{4,}|new[ _]?\d+|uname.*|unnamed.*",
    re.IGNORECASE,
)
# Parameters of the C3D group POINT that list channels of other kinds than optical points.
_TYPE_GROUPS = ("ANGLES", "FORCES", "MOMENTS", "POWERS", "SCALARS", "REACTIONS", "MODELED_MARKERS")
_COMPUTED = re.compile(
    r"[LR]?\w*(Angles?|Forces?|Moments?|Powers?|NormalisedGRF)"
    r"|[LR](HJC|KJC|AJC|SJC|EJC|WJC)"
    r"|CentreOf(Mass|Pressure)(Floor)?|CenterOf(Mass|Pressure)(Floor)?"
)
# The Oxford Foot Model: names such as LTIB1 could be markers, so they need LFOF0 in the same file.
_OXFORD = re.compile(r"([LR])(ArchHeight(Index)?|D1M0|FOF\d|HDF\d|HE1|HLX\d|PROXFF|TIB\d)")

# Points of a static trial that Plug-in-Gait scripts compute; they could be markers, so that
# LViconLegLength must stand in the same file.
_STATIC = re.compile(r"proj[LR]\w+|[LR](ViconLegLength|HFplantar|HJCHarrington|KAX|ANK1)|PEL\d")


def _bare(name: str) -> str:
    """Return a name without its subject, ``Subject:LASI`` -> ``LASI``."""
    return name.rpartition(":")[2].strip()


def is_unlabelled(name: str) -> bool:
    """Return whether a recording system gives this name to an unnamed channel.

    Parameters
    ----------
    name : str
        Name of a channel, with or without its subject.

    Returns
    -------
    bool
        True for an unnamed channel.

    Examples
    --------
    >>> [is_unlabelled(n) for n in ("*12", "", "Unlabeled 3", "New 0001", "LASI", "Ann:T10")]
    [True, True, True, True, False, False]
    """
    return _UNLABELLED.fullmatch(_bare(name)) is not None


def find_modelled(names: Sequence[str], groups: Mapping[str, Iterable[str]]) -> list[bool]:
    """Return which channels are computed instead of measured.

    Parameters
    ----------
    names : sequence of str
        Name of each channel.
    groups : mapping of str to iterable of str
        Lists of channel names by kind, as in the C3D parameters POINT:ANGLES, POINT:FORCES and so
        on.

    Returns
    -------
    list of bool
        One value for each name.

    Notes
    -----
    Computed channels are the members of those lists, the names of Plug-in-Gait, and the axes of a
    segment: four channels of one stem that end in O, A, L and P (origin, anterior, lateral,
    proximal).

    Examples
    --------
    >>> find_modelled(["LASI", "LFEO", "LFEA", "LFEL", "LFEP", "LHipAngles"], {})
    [False, True, True, True, True, True]
    """
    listed = {name for kind in _TYPE_GROUPS for name in groups.get(kind, ())}
    stems = {(name[:-1], name[-1]) for name in names if name}

    def is_axis(name: str) -> bool:
        stem = name[:-1]
        return (
            len(_bare(stem)) >= 2
            and name[-1] in "OALP"
            and all((stem, letter) in stems for letter in "OALP")
        )

    def is_oxford(name: str) -> bool:
        found = _OXFORD.fullmatch(_bare(name))
        prefix = name[: len(name) - len(_bare(name))]
        return found is not None and (f"{prefix}{found[1]}FOF", "0") in stems

    has_static = any(_bare(name)[1:] == "ViconLegLength" for name in names)
    return [
        not is_unlabelled(name)
        and (
            name in listed
            or _bare(name) in listed
            or _COMPUTED.fullmatch(_bare(name)) is not None
            or is_axis(name)
            or is_oxford(name)
            or (has_static and _STATIC.fullmatch(_bare(name)) is not None)
        )
        for name in names
    ]
