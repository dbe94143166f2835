"""Ctrl-C as a flag: the first asks for an orderly end, the second for an immediate one."""

from __future__ import annotations

import signal
from types import FrameType, TracebackType
from typing import Any, Self

SIGNALS = (signal.SIGINT, signal.SIGTERM, signal.SIGHUP)
"""SIGHUP: the terminal has been closed, or the line to it was cut."""


class Interrupts:
    """While entered, counts the signals that ask us to end instead of dying of them."""

    def __init__(self) -> None:
        """Start with none."""
        self.count = 0
        self._before: dict[signal.Signals, Any] = {}

    def __enter__(self) -> Self:
        """Take over the signals; leaves them alone where that isn't allowed (not the main thread).

        Under nohup a closed terminal stays nothing to us.
        """
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
        """Give the signals back."""
        for number, handler in self._before.items():
            signal.signal(number, handler)

    def _note(self, number: int, _frame: FrameType | None) -> None:
        # A shell and the system both tell of a closed terminal: that's no second wish.
        self.count = max(self.count, 1) if number == signal.SIGHUP else self.count + 1
