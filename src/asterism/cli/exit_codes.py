"""How a command may end: each reason has one line on stderr and one exit code."""

from __future__ import annotations

import _thread
import logging
import os
import signal
import sys
import threading
from contextlib import contextmanager
from io import TextIOWrapper
from typing import TYPE_CHECKING, NoReturn

from asterism.errors import AsterismError

if TYPE_CHECKING:
    from collections.abc import Callable, Generator

__all__ = ["BROKEN_PIPE", "exit_code"]

FAILURE, MENDABLE, BROKEN_PIPE = 1, 2, 128 + 13

log = logging.getLogger(__name__)


class Stopped(BaseException):
    """The process was asked to stop; whatever is half done is taken back on the way out."""

    def __init__(self, signum: int) -> None:
        super().__init__(signum)
        self.signum = signum


def exit_code(run: Callable[[], None]) -> int:
    """Run a command and say how it ended.

    Parameters
    ----------
    run : callable
        The command; may end by `SystemExit`.

    Returns
    -------
    int
        The exit code, see `asterism.cli.main`.
    """
    for stream in (sys.stdout, sys.stderr):
        # A name or a σ that the terminal cannot show must not end the program.
        if isinstance(stream, TextIOWrapper):
            stream.reconfigure(errors="backslashreplace")
    with _news():
        return _guarded(run)


def _guarded(run: Callable[[], None]) -> int:
    try:
        with _stopping():
            run()
            sys.stdout.flush()
    except SystemExit as end:
        return end.code if isinstance(end.code, int) else FAILURE if end.code else 0
    except Stopped as stop:
        return _say(f"stopped by {signal.Signals(stop.signum).name}", 128 + stop.signum)
    except AsterismError as error:
        return _say(str(error), MENDABLE)
    except BrokenPipeError:
        os.dup2(os.open(os.devnull, os.O_WRONLY), sys.stdout.fileno())
        return BROKEN_PIPE
    except OSError as error:
        where = f"{error.filename}: " if error.filename else ""
        return _say(f"{where}{error.strerror or error}", MENDABLE)
    except MemoryError:
        hint = "track a shorter piece of the capture, or a part of its frames"
        return _say(f"the memory is too small for this ({hint})", FAILURE)
    return 0


def _say(message: str, code: int) -> int:
    log.error(message)
    return code


@contextmanager
def _news() -> Generator[None, None, None]:
    """Let warnings and errors of the library appear on stderr, a line each."""
    handler = logging.StreamHandler(sys.stderr)
    handler.setLevel(logging.WARNING)
    handler.setFormatter(logging.Formatter("asterism: %(message)s"))
    logger = logging.getLogger("asterism")
    logger.addHandler(handler)
    try:
        yield
    finally:
        logger.removeHandler(handler)


@contextmanager
def _stopping() -> Generator[None, None, None]:
    """Turn SIGINT and SIGTERM into `Stopped`, once: a second one does not disturb the tidying."""
    if threading.current_thread() is not threading.main_thread():
        yield
        return

    def stop(signum: int, _: object) -> NoReturn:
        for number in before:
            signal.signal(number, signal.SIG_IGN)
        raise Stopped(signum)

    def again(lost: sys.UnraisableHookArgs) -> None:
        # The signal came while Python ran a finaliser or a weak reference's callback, which
        # cannot be left by an exception: it comes once more, when that is over.
        if not isinstance(lost.exc_value, Stopped):
            hook(lost)
            return
        for number in before:
            signal.signal(number, stop)
        threading.Timer(0.01, _thread.interrupt_main, [lost.exc_value.signum]).start()

    # Who started us with a signal ignored (nohup, a shell's background job) wants it ignored.
    known = {number: signal.getsignal(number) for number in (signal.SIGINT, signal.SIGTERM)}
    before = {number: handler for number, handler in known.items() if handler != signal.SIG_IGN}
    hook = sys.unraisablehook
    try:
        sys.unraisablehook = again
        for number in before:  # from the first on a signal may come
            signal.signal(number, stop)
        yield
    finally:
        sys.unraisablehook = hook
        for number, handler in before.items():
            signal.signal(number, handler)
