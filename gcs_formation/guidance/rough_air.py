"""How rough the air is at the leader.

In rough air followers are off their slots by gusts of their own, so the leader needn't spare them millimetres and may
keep to its path by a higher bandwidth. A single gust isn't rough air: its size counts up to a bound, for seconds of a
minute.
"""

from __future__ import annotations

import math
from typing import Final

from flight_model.autopilot_model import within

CHANGE_RADPS: Final = 1.0
"""Faster changes of the wind than this count. Of Dryden's turbulence in a wind of 7 m/s they are 0.2 m/s on average.
Tuned: rad/s; 0.5 to 2; shown by `pytest tests/gcs_formation/guidance`."""
GUST_MPS: Final = 0.5
"""A larger change counts as one of this size. Tuned: m/s; 0.3 to 1; shown by `pytest tests/gcs_formation/guidance`."""
MEMORY_S: Final = 60.0
"""Averaging time: turbulence lasts for minutes, a gust for seconds. Tuned: s; 30 to 180; shown by `pytest
tests/gcs_formation/guidance`."""
CALM_MPS: Final = 0.08
"""Mean changes up to which air is calm. Tuned: m/s; 0.05 to below `ROUGH_MPS`; shown by `pytest
tests/gcs_formation/guidance`."""
ROUGH_MPS: Final = 0.16
"""Mean changes up to which air is calm, and from which on it is rough. Telemetry's noise of `configs/noise.yaml` makes
0.012 m/s, a gust of 0.85 m/s 0.01 m/s, turbulence of a wind of 3 m/s 0.086 m/s. Tuned: m/s; 0.1 to 0.3; shown by the
flights named here."""


class RoughAir:
    """The mean size of fast changes of the wind."""

    def __init__(self, dt_s: float) -> None:
        """Begin in calm air; `dt_s` is the time between observations."""
        self._dt_s = dt_s
        self._north_mps = self._east_mps = math.nan
        """The wind without its fast changes."""
        self.changes_mps = 0.0
        """Mean size of the fast changes."""

    def drop_state(self) -> None:
        """Begin with the next wind: another vehicle observes it."""
        self._north_mps = self._east_mps = math.nan

    def observe(self, north_mps: float, east_mps: float) -> None:
        """Take the wind of a tick."""
        if math.isnan(self._north_mps):
            self._north_mps, self._east_mps = north_mps, east_mps
        north_off_mps, east_off_mps = north_mps - self._north_mps, east_mps - self._east_mps
        share = min(self._dt_s * CHANGE_RADPS, 1.0)
        self._north_mps += share * north_off_mps
        self._east_mps += share * east_off_mps
        size_mps = min(math.hypot(north_off_mps, east_off_mps), GUST_MPS)
        self.changes_mps += min(self._dt_s / MEMORY_S, 1.0) * (size_mps - self.changes_mps)

    @property
    def share(self) -> float:
        """How rough it is, from 0 in calm air to 1."""
        return within((self.changes_mps - CALM_MPS) / (ROUGH_MPS - CALM_MPS), 0.0, 1.0)
