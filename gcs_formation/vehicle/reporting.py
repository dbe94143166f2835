# Compiled by mypyc: with each message.

"""How often a quantity is reported, and whether it isn't any more while others are."""

from __future__ import annotations

import math
from typing import Final

UNASKED_S: Final = 1.0
"""Interval at which an autopilot reports of itself what it hasn't been asked for yet, s: 1 Hz and more."""
INTERVALS: Final = 4.0
"""A quantity is lacking after so many of its own intervals: a request for it that is still lost on the way, and
messages lost before, are no end of it. Tuned: intervals; 3 to 6; of ten messages in a hundred that are lost, two in a
row are one in a hundred, three in a row one in a thousand."""
WEIGHT: Final = 0.25
"""Of the newest interval in the usual one."""


class Reporting:
    """When one quantity was reported, by the vehicle's clock, and how many others have been since."""

    def __init__(self, few: int, patience_s: float) -> None:
        """It lacks after more than `few` others alone, over at least `patience_s`."""
        self._few, self._patience_s = few, patience_s
        self.begin()

    def begin(self) -> None:
        """Reset, as after a restart."""
        self.others = 0
        """Others since the last of its own."""
        self.stamp_s = math.nan
        """Of its last."""
        self._every_s = UNASKED_S

    def take(self, stamp_s: float) -> None:
        """Take one of its own; a stamp that isn't later than the one before says nothing of the interval."""
        elapsed_s = stamp_s - self.stamp_s
        if elapsed_s > 0.0:
            self._every_s += WEIGHT * (min(elapsed_s, UNASKED_S) - self._every_s)
        self.others, self.stamp_s = 0, stamp_s

    def lacks(self, stamp_s: float) -> bool:
        """Return whether it isn't reported any more; `stamp_s`: of the last of the others."""
        silent_s = stamp_s - self.stamp_s
        return self.others > self._few and silent_s > max(self._patience_s, INTERVALS * self._every_s)
