"""Ctrl-C while a command is still being imported: the process ends without a traceback, as it does later."""

from __future__ import annotations

import os
import signal
from types import FrameType

INTERRUPTED = 130


def end_quietly() -> None:
    """End the process with status 130 on Ctrl-C, until the command installs a handler of its own."""
    if signal.getsignal(signal.SIGINT) is signal.default_int_handler:
        signal.signal(signal.SIGINT, _end)


def _end(_number: int, _frame: FrameType | None) -> None:
    os._exit(INTERRUPTED)
