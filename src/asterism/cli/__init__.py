"""The command line: a thin face over the library, and the only place that prints and exits."""

from __future__ import annotations

from typing import TYPE_CHECKING

if TYPE_CHECKING:
    from collections.abc import Sequence

__all__ = ["main"]


def main(arguments: Sequence[str] | None = None) -> int:
    """Run ``asterism`` and give its exit code.

    Parameters
    ----------
    arguments : sequence of str, optional
        What follows the name of the program; those of the process unless given.

    Returns
    -------
    int
        0 after success, 2 where the user can mend what went wrong, 1 where memory ran out, 130 and
        143 when stopped by SIGINT and SIGTERM, 141 when nobody reads the output any more. A fault
        of the program itself is not caught: Python prints it and exits with 1.
    """
    from asterism.cli.exit_codes import exit_code

    def run() -> None:
        from asterism.cli.program import command
        from asterism.cli.usage import run_command

        run_command(command, None if arguments is None else list(arguments))

    return exit_code(run)
