"""Errors in the arguments of the command line, in the form of all other messages."""

from __future__ import annotations

import re
from typing import Any

import typer

from asterism.checks import check_fields
from asterism.errors import ParameterError

__all__ = ["run_command"]

# Typer has no public name for the base class of its parser's errors.
_UsageError: type[Exception] = typer.BadParameter.__mro__[1]
_KINDS = {"int_parsing": "a whole number", "float_parsing": "a number"}


def run_command(command: Any, arguments: list[str] | None) -> None:
    """Run the command line.

    Parameters
    ----------
    command : click command
        Command of the whole program.
    arguments : list of str or None
        Arguments after the name of the program. None stands for those of the process.

    Raises
    ------
    ParameterError
        If the arguments do not fit the command.
    SystemExit
        If a command ends with an exit code.
    """
    try:
        code = command(args=arguments, prog_name="asterism", standalone_mode=False)
    except _UsageError as error:
        message = str(getattr(error, "message", error))
        if type(error).__name__ == "NoArgsIsHelpError":  # it has printed the help
            raise SystemExit(2) from None
        _diagnose(error, message)
        where = _command(error)
        raise ParameterError(where, "", message.rstrip("."), "see asterism --help") from error
    if isinstance(code, int) and code:
        raise SystemExit(code)


def _command(error: Any) -> str:
    """Return the name of the command; every message begins with the program's name anyway."""
    path = "asterism" if error.ctx is None else error.ctx.command_path
    return path.partition(" ")[2] or "COMMAND"


def _diagnose(error: Any, message: str) -> None:
    """Raise the error in the form of the library's messages, if its cause is known."""
    command: Any = None if error.ctx is None else error.ctx.command
    if hasattr(error, "possibilities"):
        every = [name for p in command.params for name in p.opts if name.startswith("--")]
        check_fields(_command(error), [error.option_name], [*every, "--help"])
    elif hasattr(error, "option_name"):
        counts = ("a value", "nothing") if "requires" in message else ("no value", "one")
        raise ParameterError(error.option_name, *counts)
    missing = re.match(r"No such command '(.*?)'", message)
    if missing is not None:
        check_fields(_command(error), [missing[1]], command.commands)
    surplus = re.search(r"unexpected extra argument.*? \((.*)\)", message)
    if surplus is not None:
        hint = f"see asterism {_command(error)} --help"
        raise ParameterError(_command(error), "no more arguments", repr(surplus[1]), hint)
    parameter = getattr(error, "param", None)
    if parameter is None:
        return
    name: str = max(parameter.opts, key=len)
    name = name if name.startswith("-") else parameter.metavar or name.upper()
    if hasattr(error, "param_type"):
        raise ParameterError(name, "a value", "nothing", f"see asterism {_command(error)} --help")
    refused = getattr(error.__cause__, "errors", list[Any])()
    if not refused:
        raise ParameterError(name, "", message)
    found = refused[0]["input"]
    choices = re.search(r"is not one of (.*?)\.?$", message)
    if choices is not None:
        check_fields(name, [found], re.findall(r"'(.*?)'", choices[1]))
    if refused[0]["type"] in _KINDS:
        raise ParameterError(name, _KINDS[refused[0]["type"]], repr(found))
    raise ParameterError(name, "", message)
