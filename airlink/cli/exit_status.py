"""How commands end: exit statuses, last words, Ctrl-C."""

from __future__ import annotations

import os
import signal
import sys
from collections.abc import Generator
from contextlib import contextmanager
from enum import IntEnum
from types import FrameType
from typing import NoReturn

import click

SIGNALS = (signal.SIGINT, signal.SIGTERM)


class Status(IntEnum):
    """Exit statuses of all commands."""

    FINE = 0
    EXPECTATION_BROKEN = 1
    BAD_USAGE = 2
    COULD_NOT_GO_ON = 3
    INTERRUPTED = 130


def say(text: str, status: Status) -> Status:
    """Print a message to standard error; return the status."""
    click.echo(text, err=True)
    return status


def fail(text: str, status: Status = Status.BAD_USAGE) -> NoReturn:
    """Print a message to standard error and exit."""
    sys.exit(say(text, status))


def end_quietly() -> None:
    """End the process with status 130 on Ctrl-C, until the command installs a handler of its own."""
    if signal.getsignal(signal.SIGINT) is signal.default_int_handler:
        signal.signal(signal.SIGINT, _end)


def end_unheard(error: OSError) -> NoReturn:
    """Exit: what was said can't be written (a full disk, a pipe whose reader has gone).

    What is left of it is dropped; otherwise Python would fail to write it once more as it ends, and choose the status.
    """
    nowhere = os.open(os.devnull, os.O_WRONLY)
    try:
        say(f"cannot go on: {error}", Status.COULD_NOT_GO_ON)
    except OSError:
        os.dup2(nowhere, sys.__stderr__.fileno() if sys.__stderr__ else nowhere)
    os.dup2(nowhere, sys.__stdout__.fileno() if sys.__stdout__ else nowhere)
    sys.exit(Status.COULD_NOT_GO_ON)


@contextmanager
def raised() -> Generator[None]:
    """Within, the first Ctrl-C or SIGTERM raises KeyboardInterrupt; the second ends the process at once."""
    before = {number: signal.getsignal(number) for number in SIGNALS}
    taken = [number for number, handler in before.items() if handler is not signal.SIG_IGN]
    for number in taken:
        signal.signal(number, _raise)
    try:
        yield
    finally:
        for number in taken:
            signal.signal(number, before[number])


def _raise(_number: int, _frame: FrameType | None) -> None:
    for number in SIGNALS:
        signal.signal(number, _end)
    raise KeyboardInterrupt


def _end(_number: int, _frame: FrameType | None) -> None:
    os._exit(Status.INTERRUPTED)
