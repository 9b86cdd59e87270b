"""Ends of a command: one line on stderr and one exit code for each reason."""

from __future__ import annotations

import _thread
import logging
import os
import signal
import sys
import threading
from contextlib import contextmanager
from io import TextIOWrapper
from typing import TYPE_CHECKING

from asterism.errors import AsterismError

if TYPE_CHECKING:
    from collections.abc import Callable, Generator
    from types import FrameType

__all__ = ["BROKEN_PIPE", "exit_code"]

FAILURE, USER_ERROR, BROKEN_PIPE = 1, 2, 128 + 13

log = logging.getLogger(__name__)


class Stopped(BaseException):
    """A signal stops the process; unfinished files are removed on the way out."""

    def __init__(self, signum: int) -> None:
        super().__init__(signum)
        self.signum = signum


def exit_code(run: Callable[[], None]) -> int:
    """Run a command and return its exit code.

    Parameters
    ----------
    run : callable
        The command. It may raise `SystemExit`.

    Returns
    -------
    int
        The exit code, see `asterism.cli.main`.
    """
    for stream in (sys.stdout, sys.stderr):
        # A character that the terminal cannot show must not raise an error.
        if isinstance(stream, TextIOWrapper):
            stream.reconfigure(errors="backslashreplace")
    with _log_messages():
        return _guarded(run)


def _guarded(run: Callable[[], None]) -> int:
    try:
        with _stopping():
            run()
            sys.stdout.flush()
    except SystemExit as end:
        return end.code if isinstance(end.code, int) else FAILURE if end.code else 0
    except Stopped as stop:
        return _fail(f"stopped by {signal.Signals(stop.signum).name}", 128 + stop.signum)
    except AsterismError as error:
        return _fail(str(error), USER_ERROR)
    except BrokenPipeError:
        os.dup2(os.open(os.devnull, os.O_WRONLY), sys.stdout.fileno())
        return BROKEN_PIPE
    except OSError as error:
        where = f"{error.filename}: " if error.filename else ""
        return _fail(f"{where}{error.strerror or error}", USER_ERROR)
    except MemoryError:
        return _fail("not enough memory. Use fewer frames of the capture.", FAILURE)
    return 0


def _fail(message: str, code: int) -> int:
    log.error(message)
    return code


@contextmanager
def _log_messages() -> Generator[None, None, None]:
    """Print warnings and errors of the library on stderr, one line each."""
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
    """Raise `Stopped` at the first SIGINT or SIGTERM, and ignore later ones during the cleanup."""
    if threading.current_thread() is not threading.main_thread():
        yield
        return

    def stop(signum: int, frame: FrameType | None) -> None:
        while frame is not None:
            if frame.f_code is again.__code__:  # where an exception would be lost too
                send_later(signum)
                return
            frame = frame.f_back
        for number in before:
            signal.signal(number, signal.SIG_IGN)
        raise Stopped(signum)

    def again(lost: sys.UnraisableHookArgs) -> None:
        # The signal arrived during a finaliser or the callback of a weak reference, where Python
        # discards exceptions. It is sent again until one of them stops the command.
        if not isinstance(lost.exc_value, Stopped):
            hook(lost)
            return
        for number in before:
            signal.signal(number, stop)
        send_later(lost.exc_value.signum)

    def send_later(signum: int) -> None:
        if not senders:
            sender = threading.Thread(target=send, args=[signum], daemon=True)
            senders.append(sender)
            sender.start()

    def send(signum: int) -> None:
        while not ended.wait(0.01):
            _thread.interrupt_main(signal.Signals(signum))

    # A signal that the parent process ignores (nohup, a background job) stays ignored.
    known = {number: signal.getsignal(number) for number in (signal.SIGINT, signal.SIGTERM)}
    before = {number: handler for number, handler in known.items() if handler != signal.SIG_IGN}
    hook, ended = sys.unraisablehook, threading.Event()
    senders: list[threading.Thread] = []
    try:
        sys.unraisablehook = again
        for number in before:  # a signal may arrive from the first one on
            signal.signal(number, stop)
        yield
    finally:
        ended.set()
        for each in senders:
            each.join()
        sys.unraisablehook = hook
        for number, handler in before.items():
            signal.signal(number, handler)
