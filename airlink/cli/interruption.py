"""Ctrl-C: the end without a traceback while a command is still being imported, and an end in order afterwards."""

from __future__ import annotations

import os
import signal
from collections.abc import Generator
from contextlib import contextmanager
from types import FrameType

INTERRUPTED = 130
SIGNALS = (signal.SIGINT, signal.SIGTERM)


def end_quietly() -> None:
    """End the process with status 130 on Ctrl-C, until the command installs a handler of its own."""
    if signal.getsignal(signal.SIGINT) is signal.default_int_handler:
        signal.signal(signal.SIGINT, _end)


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
    os._exit(INTERRUPTED)
