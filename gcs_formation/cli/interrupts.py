"""Termination signals that end a measurement or a transfer in order; what has come is kept."""

from __future__ import annotations

import signal
from types import FrameType
from typing import Any

from airlink.cli import SIGNALS


class Interrupts:
    """While entered, termination signals are counted instead of ending the process."""

    def __init__(self) -> None:
        """Start with none."""
        self.count = 0
        self._before: dict[signal.Signals, Any] = {}

    def __enter__(self) -> None:
        """Take the signals."""
        self._before = {number: signal.signal(number, self._receive) for number in SIGNALS}

    def __exit__(self, *_: object) -> None:
        """Give them back to whom they went before."""
        for number, handler in self._before.items():
            signal.signal(number, handler)

    def _receive(self, _number: int, _frame: FrameType | None) -> None:
        self.count += 1
