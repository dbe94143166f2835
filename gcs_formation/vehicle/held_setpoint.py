"""The setpoint that a vehicle holds: what it was last sent of each quantity, and when a newer one is news to it.

A setpoint jitters at every tick by what telemetry is rounded to, and a vehicle's time constants smooth that: what
counts is the time for which it is off. So a quantity is sent once the integral of its deviation from what the vehicle
holds would exceed a tolerance by the next tick (integral send-on-delta sampling: Miskowicz, "Event-based sampling by an
integral criterion", Sensors 2007). A step is sent at once, a ramp often, and rounding hardly ever. On a ramp each value
is late by half of the time for which it is held: of heights that of the middle is sent instead, which over hills keeps
followers within 3 cm of their slots' heights (13 cm without).
"""

from __future__ import annotations

import math
from typing import Final

from librt.vecs import vec

from airlink.clock import Instant, seconds_between
from flight_model.autopilot_model import within, wrap
from flight_model.slot import UNKNOWN, Vector3

Which = tuple[bool, bool, bool]
"""Whether each of airspeed, heading and height is meant."""
SPEED: Final = 0
HEADING: Final = 1
HEIGHT: Final = 2
ALONG_M: Final = 0.002
ACROSS_M: Final = 0.001
HEIGHT_M_S: Final = 0.21
"""Tolerances of the integrals: displacement along and across the heading, m, of a vehicle that followed at once, and
height times time, m s. Followed with time constants of 4 s for airspeed and 1 and 3 s for height, these are less. Of
the quickstart's errors they leave each within 4 mm of what sending everything gives. They bound the steps, too: on a
ramp of a m/s² airspeed changes by steps of the root of 2 a `ALONG_M`, 6 mm/s at 1 cm/s²."""
FINE_HEIGHT_M_S: Final = 0.05
"""The height's over terrain, whose hills command climbs and descents without end, and of an aircraft under total-energy
control, which trades its height for airspeed in bends: 0.2 m s cost either 0.1 m."""
CLIMB_S: Final = 0.3
"""Time constant with which the rate of commanded heights is smoothed, s: telemetry's rounding moves them by 0.1 m/s
from tick to tick. Tuned: s; 0.2 to 1; shown by `pytest tests/gcs_formation/vehicle`."""
MIN_CLIMB_MPS: Final = 0.3
"""Rate below which heights are late by too little to matter. Tuned: m/s; 0.2 to 1; shown by `pytest
tests/gcs_formation/vehicle`."""
STEADY: Final = 2.0
"""Heights are on a ramp where the newest rate and the smoothed one differ by less than this factor: neither at a step
nor where a ramp ends at a limit. Tuned: ratio; 1.5 to 3; shown by `pytest tests/gcs_formation/vehicle`."""
SHORTEST_S: Final = 0.02
LONGEST_S: Final = 1.0
"""Shortest and longest time between two setpoints that counts."""


class HeldSetpoint:
    """What one vehicle holds of airspeed, heading and height."""

    def __init__(self) -> None:
        """Start with a vehicle that holds nothing of ours."""
        self.height_m_s = HEIGHT_M_S
        """Tolerance of the height's integral, m s."""
        self.values: Vector3 = UNKNOWN
        """Airspeed in m/s, heading in rad and height in m of the law's setpoints, as sent last; NaN before."""
        self._encoded: Vector3 = UNKNOWN
        """The same as the vehicle's messages encode it."""
        self._owed = vec[float]([0.0, 0.0, 0.0])
        """The integrals of the deviations since each was sent."""
        self._judged = Instant(0)
        self._wanted_m, self._climb_mps = math.nan, 0.0
        """The height wanted last, and how fast it has changed."""

    def height_ahead_m(self, height_m: float, at: Instant) -> float:
        """Return the height of the middle of the time for which a height wanted at an instant will be held, m.

        On a ramp each would be late by half of that time otherwise. Within the tolerance it takes the root of twice
        the tolerance a rate.
        """
        elapsed_s = within(seconds_between(self._judged, at), SHORTEST_S, LONGEST_S)
        rate_mps = (height_m - self._wanted_m) / elapsed_s
        self._wanted_m = height_m
        if math.isnan(rate_mps):
            return height_m
        self._climb_mps += min(1.0, elapsed_s / CLIMB_S) * (rate_mps - self._climb_mps)
        climb_mps = self._climb_mps
        ramp = rate_mps * climb_mps > 0.0 and 1.0 / STEADY < rate_mps / climb_mps < STEADY
        if not ramp or abs(climb_mps) < MIN_CLIMB_MPS:
            return height_m
        return height_m + climb_mps * math.sqrt(2.0 * self.height_m_s / abs(climb_mps)) / 2.0

    def invalidate(self) -> None:
        """Take everything for news: the vehicle may hold others' setpoints."""
        self.values = self._encoded = UNKNOWN

    def news(self, encoded: Vector3, at: Instant, tolerance: float = 1.0, prompt_share: float = 1.0) -> Which:
        """Return which of airspeed, heading and height, as messages encode them at an instant, are news.

        `tolerance`: multiple of the tolerances; `prompt_share`: of a change of airspeed, what is flown at once.
        """
        elapsed_s = within(seconds_between(self._judged, at), SHORTEST_S, LONGEST_S)
        self._judged = at
        off_mps, off_rad = encoded[SPEED] - self._encoded[SPEED], wrap(encoded[HEADING] - self._encoded[HEADING])
        off_m = encoded[HEIGHT] - self._encoded[HEIGHT]
        return (
            self._is_news(SPEED, prompt_share * off_mps * elapsed_s, tolerance * ALONG_M),
            self._is_news(HEADING, encoded[SPEED] * off_rad * elapsed_s, tolerance * ACROSS_M),
            self._is_news(HEIGHT, off_m * elapsed_s, tolerance * self.height_m_s),
        )

    def _is_news(self, quantity: int, more: float, tolerance: float) -> bool:
        if math.isnan(more):
            return True
        self._owed[quantity] += more
        return abs(self._owed[quantity]) > tolerance

    def send(self, wanted: Vector3, encoded: Vector3, which: Which) -> None:
        """Take what is sent of a setpoint."""
        values, held = list(self.values), list(self._encoded)
        for quantity in (SPEED, HEADING, HEIGHT):
            if which[quantity]:
                values[quantity], held[quantity], self._owed[quantity] = wanted[quantity], encoded[quantity], 0.0
        self.values = values[0], values[1], values[2]
        self._encoded = held[0], held[1], held[2]
