"""Command line of the library. No other package prints or ends the process."""

from __future__ import annotations

from typing import TYPE_CHECKING

if TYPE_CHECKING:
    from collections.abc import Sequence

__all__ = ["main"]


def main(arguments: Sequence[str] | None = None) -> int:
    """Run the command line ``asterism`` and return its exit code.

    Parameters
    ----------
    arguments : sequence of str, optional
        Arguments after the name of the program. The default is those of the process.

    Returns
    -------
    int
        0 after success, 2 after an error that the user can correct, 1 after a failed check or
        without enough memory, 130 and 143 after SIGINT and SIGTERM, 141 if the reader of the output
        has closed the pipe. Python prints other exceptions and exits with 1.

    Examples
    --------
    >>> main(["--version"])
    asterism 0.1.0
    0
    """
    from asterism.cli.exit_codes import exit_code

    def run() -> None:
        from asterism.cli.program import command
        from asterism.cli.usage import run_command

        run_command(command, None if arguments is None else list(arguments))

    return exit_code(run)
