"""Whether a measured airspeed can be a flying aircraft's, and what stands in for one that can't.

A sensor that fails reads 0, or sticks. Taken for airspeed, that shows an acceleration that nobody flies and a wind that
nobody feels. What no flight reads isn't believed as long as velocity over ground and the wind known so far show an
airspeed that is flown: that one, the synthetic airspeed, is taken instead. While it is, wind along the nose is kept
and wind across it still followed. A gust changes airspeed or velocity over ground, but keeps the former within what
is flown, so gusts are believed whatever their size.

Source: ArduPilot, synthetic airspeed of EKF3; PX4, Airspeed Validation.
"""

from __future__ import annotations

import math
from typing import Final

SLOWEST_SHARE: Final = 0.7
"""Share of the lowest airspeed told below which nobody flies: a wing has to lift twice as well as there."""
FASTEST_SHARE: Final = 1.2
"""Share of the highest one above which nobody flies for long: drag grows by half."""
OFF_SHARE: Final = 0.25
"""Share of the lowest one by which a reading has to be off what velocity over ground and wind show as well."""
RETURN_SHARE: Final = 0.5
"""The share of all these margins within which a reading has to be to be believed again."""
RETURN_S: Final = 2.0
"""For how long it has to."""
WIND_S: Final = 30.0
"""Over about so long the wind is averaged: a sensor that ices up loses 1 m/s in a second, and what it shows until it is
found out makes little of that."""


class AirspeedCheck:
    """One aircraft's."""

    __slots__ = (
        "_east_mps",
        "_fastest_mps",
        "_north_mps",
        "_plausible_s",
        "_slowest_mps",
        "_stamp_s",
        "believes",
        "synthetic_mps",
    )

    def __init__(self, slowest_mps: float, fastest_mps: float) -> None:
        """Believe readings; those that are told are between the two limits."""
        self._slowest_mps, self._fastest_mps = slowest_mps, fastest_mps
        self._north_mps: float = 0.0
        self._east_mps: float = 0.0
        """The wind; calm before the first reading."""
        self._stamp_s: float = math.nan
        self._plausible_s: float = 0.0
        """For how long readings that aren't believed have been plausible again."""
        self.believes = True
        """Whether the newest reading is believed."""
        self.synthetic_mps: float = math.nan
        """The newest true airspeed by velocity over ground and wind."""

    def take(
        self,
        stamp_s: float,
        north_mps: float,
        east_mps: float,
        heading_rad: float,
        reading_mps: float,
        ratio: float,
    ) -> bool:
        """Return whether an aircraft's reading in the air is believed.

        Args:
            stamp_s: when it was measured, by the vehicle's clock.
            north_mps: velocity over ground.
            east_mps: likewise.
            heading_rad: of the nose.
            reading_mps: what the sensor reads.
            ratio: true airspeed by what the sensor reads.
        """
        cos, sin = math.cos(heading_rad), math.sin(heading_rad)
        begins, elapsed_s = math.isnan(self._stamp_s), stamp_s - self._stamp_s
        self._stamp_s = stamp_s
        self.synthetic_mps = (north_mps - self._north_mps) * cos + (east_mps - self._east_mps) * sin
        self._judge(reading_mps, self.synthetic_mps / ratio, elapsed_s)
        airspeed_mps = ratio * reading_mps if self.believes else self.synthetic_mps
        share = 1.0 if begins else 1.0 - math.exp(-max(elapsed_s, 0.0) / WIND_S)
        self._north_mps += share * (north_mps - airspeed_mps * cos - self._north_mps)
        self._east_mps += share * (east_mps - airspeed_mps * sin - self._east_mps)
        return self.believes

    def _judge(self, reading_mps: float, expected_mps: float, elapsed_s: float) -> None:
        if self.believes:
            self.believes = self._is_plausible(reading_mps, expected_mps, 1.0) or not self._is_flown(expected_mps, 1.0)
            self._plausible_s = 0.0
            return
        self._plausible_s += elapsed_s
        if not self._is_plausible(reading_mps, expected_mps, RETURN_SHARE):
            self._plausible_s = 0.0
        self.believes = self._plausible_s >= RETURN_S

    def _is_plausible(self, reading_mps: float, expected_mps: float, share: float) -> bool:
        """Return whether a reading is flown or as expected, within a share of the margins."""
        off_mps = abs(reading_mps - expected_mps)
        return off_mps < share * OFF_SHARE * self._slowest_mps or self._is_flown(reading_mps, share)

    def _is_flown(self, reading_mps: float, share: float) -> bool:
        """Return whether a reading is within a share of the margins around those that are told."""
        lowest = 1.0 - share * (1.0 - SLOWEST_SHARE)
        highest = 1.0 + share * (FASTEST_SHARE - 1.0)
        return lowest * self._slowest_mps <= reading_mps <= highest * self._fastest_mps
