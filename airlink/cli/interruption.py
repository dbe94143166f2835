"""Ctrl-C while a command is still being imported: it ends as any other, without a traceback."""

from __future__ import annotations

import os
import signal
from types import FrameType

INTERRUPTED = 130


def end_quietly() -> None:
    """Have Ctrl-C end the process with 130 from now on; what the command itself does about it comes later."""
    if signal.getsignal(signal.SIGINT) is signal.default_int_handler:
        signal.signal(signal.SIGINT, _end)


def _end(_number: int, _frame: FrameType | None) -> None:
    os._exit(INTERRUPTED)
