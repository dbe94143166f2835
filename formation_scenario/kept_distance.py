"""The distance by which a formation is planned: that which is kept in flight by what features bring, if any."""

from __future__ import annotations

from typing import Final

SEPARATION_M: Final = 5.0
"""Least distance of two vehicles unless a scenario says another, m."""
BUFFER_M: Final = 5.0
"""By how much the distance that vehicles keep exceeds the least distance, m, unless a scenario says another."""


class KeepsDistance:
    """Keys of what keeps vehicles at a larger separation in flight than they must have."""

    @property
    def kept_m(self) -> float:
        """The distance that it keeps, m."""
        raise NotImplementedError
