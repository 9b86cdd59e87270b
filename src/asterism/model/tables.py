"""Import of the libraries of the extra ``tables``: pandas and xarray."""

from __future__ import annotations

import importlib
from typing import Any

from asterism.errors import ParameterError

__all__ = ["tables_module"]


def tables_module(name: str) -> Any:
    """Import pandas or xarray and return the module.

    Raises
    ------
    ParameterError
        If the library is not installed.
    """
    try:
        return importlib.import_module(name)
    except ModuleNotFoundError as error:
        if error.name != name:
            raise
        hint = "run pip install 'asterism[tables]'"
        raise ParameterError(
            name, "the library of that name", "it is not installed", hint
        ) from error
