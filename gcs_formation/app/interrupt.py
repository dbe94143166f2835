"""Counts interrupts: the first requests an orderly end, the second an immediate one."""

from __future__ import annotations

import signal
from types import FrameType, TracebackType
from typing import Any, Self

SIGNALS = (signal.SIGINT, signal.SIGTERM, signal.SIGHUP)
"""SIGHUP: the terminal was closed, or the connection to it was lost."""


class Interrupts:
    """While entered, counts the signals that request our end, instead of being terminated by them."""

    def __init__(self) -> None:
        """Start with none."""
        self.count = 0
        self._before: dict[signal.Signals, Any] = {}

    def __enter__(self) -> Self:
        """Install the handlers, unless this isn't the main thread. Under nohup, SIGHUP stays ignored."""
        nohup = signal.getsignal(signal.SIGHUP) is signal.SIG_IGN
        taken = [number for number in SIGNALS if not (nohup and number is signal.SIGHUP)]
        try:
            self._before = {number: signal.signal(number, self._note) for number in taken}
        except ValueError:
            self._before = {}
        return self

    def __exit__(
        self, kind: type[BaseException] | None, error: BaseException | None, trace: TracebackType | None
    ) -> None:
        """Restore the previous handlers."""
        for number, handler in self._before.items():
            signal.signal(number, handler)

    def _note(self, number: int, _frame: FrameType | None) -> None:
        # A closed terminal is signalled by both the shell and the system: that isn't a second request.
        self.count = max(self.count, 1) if number == signal.SIGHUP else self.count + 1
