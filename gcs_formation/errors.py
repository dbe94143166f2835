"""Errors of the ground station."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any


class StationError(Exception):
    """Root of the ground station's errors; the message says what was found and what is allowed."""


class RunAbortedError(StationError):
    """The run could not go on: a port is taken, no vehicle answered, a vehicle refused."""

    def __init__(self, text: str, figures: Mapping[str, Any] | None = None) -> None:
        """Take why, and what `summary.json` has where there is one."""
        super().__init__(text)
        self.figures = figures


class NotFiniteError(StationError):
    """A part of the control cycle returned a value that is NaN or infinite, or failed to compute one."""

    def __init__(self, part: str, index: int | None, found: str) -> None:
        """Take the part, the index of the vehicle that its output is for (None: not known), and the values in words.

        Without an index nothing was returned: `found` is the error of the computation.
        """
        super().__init__(f"{part}: {found}")
        self.part, self.index, self.found = part, index, found


class RecordingError(RunAbortedError):
    """The record can't be written any more, usually because the disk is full."""


class NothingRunningError(StationError):
    """No running flight answers in a run directory."""


class RecordError(StationError):
    """A run directory that can't be written, or isn't one."""
