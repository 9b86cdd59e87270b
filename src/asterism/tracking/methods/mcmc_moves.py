"""Kinds of moves of Markov chain Monte Carlo data association, and their weights."""

from __future__ import annotations

from collections.abc import Mapping

from asterism.checks import check_fields, check_number
from asterism.errors import ParameterError

__all__ = ["MOVES", "WEIGHTS", "checked_weights"]

MOVES = (
    "birth",
    "death",
    "split",
    "merge",
    "extension",
    "reduction",
    "update",
    "switch",
    "insertion",
    "deletion",
    "transfer",
    "replacement",
    "exchange",
    "relocation",
)
"""Kinds of moves; the last six are not in the 2010 report."""

WEIGHTS: dict[str, dict[str, float]] = {
    "uniform": dict.fromkeys(MOVES, 1.0),
    # Equation 4.7 of the report, one weight for each kind.
    "report": {
        "birth": 1.0,
        "death": 1.0,
        "split": 2.0,
        "merge": 2.0,
        "extension": 9.0,
        "reduction": 5.0,
        "switch": 5.0,
        "update": 5.0,
    },
}
PAIRS = (
    ("birth", "death"),
    ("split", "merge"),
    ("extension", "reduction"),
    ("insertion", "deletion"),
)


def checked_weights(weights: str | Mapping[str, float]) -> Mapping[str, float]:
    """Return the weight of each kind of move.

    Parameters
    ----------
    weights : str or mapping
        "uniform", "report", or weights by kind.

    Returns
    -------
    mapping of str to float
        Weights by kind; kinds that are not in it are never proposed.

    Raises
    ------
    ParameterError
        If a kind is unknown, a weight is not a number ≥ 0, or a move lacks its reverse move.

    Examples
    --------
    >>> checked_weights({"birth": 1, "death": 1, "update": 2})
    {'birth': 1, 'death': 1, 'update': 2}
    >>> checked_weights({"birth": 1})
    Traceback (most recent call last):
    ...
    asterism.errors.ParameterError: chain.move_weights: expected birth and death both or neither,
    found {'birth': 1}. A move without its reverse is never accepted.
    """
    if isinstance(weights, str):
        check_fields("chain.move_weights", [weights], WEIGHTS)
        return WEIGHTS[weights]
    if not isinstance(weights, Mapping):  # pyright: ignore[reportUnnecessaryIsInstance]
        raise ParameterError(
            "chain.move_weights", "'uniform', 'report' or a mapping", repr(weights)
        )
    check_fields("chain.move_weights", weights, MOVES)
    for move, weight in weights.items():
        check_number(f"chain.move_weights[{move}]", weight, above=0, closed=True)
    if not weights.get("birth"):
        raise ParameterError("chain.move_weights", "births among the moves", dict(weights))
    for one, other in PAIRS:
        if bool(weights.get(one)) != bool(weights.get(other)):
            raise ParameterError(
                "chain.move_weights", f"{one} and {other} both or neither", dict(weights),
                "a move without its reverse is never accepted",
            )  # fmt: skip
    return weights
