# Compiled by mypyc: it runs every tick.

"""Whether a multirotor's heading can be true: its nose may point anywhere, so its course shows nothing.

Two messages report the heading, ATTITUDE's `yaw` and GLOBAL_POSITION_INT's `hdg`, and the gyroscopes measure how fast
it turns, ATTITUDE's `yawspeed`. So each heading is compared with the integral of that rate, and the two with each
other: a heading that is altered on its way is altered in one message, one that its estimator gets wrong jumps in both.
(Bank and pitch are those of a multirotor's acceleration, but a wind tilts it as well, by more than it accelerates.)
"""

from __future__ import annotations

import math
from typing import Final

from airlink.messages.telemetry import Attitude
from flight_model.autopilot_model import wrap
from gcs_formation.features.telemetry_health.heading_and_airspeed import HeadingCheck

DIFFERENCE_RAD: Final = 0.25
"""Headings of one time that differ by more contradict each other."""
TOGETHER_S: Final = 0.15
"""Headings whose stamps differ by no more are compared: carried over the time between at the present yaw rate they are
off by half its change, less than 0.1 rad."""
CONFIRMED: Final = 3
"""So many in a row: a single one is an outlier."""
RETURNS_S: Final = 3.0
"""They agree again once they have for this time."""
ACCEPTED: Final = 0
SHIFTED: Final = 1
OTHER: Final = 2


class NoseCheck:
    """The heading of one multirotor."""

    def __init__(self, turn_max_rps: float) -> None:
        """Start by accepting it."""
        self._of_attitude, self._of_position = HeadingCheck(turn_max_rps), HeadingCheck(turn_max_rps)
        self._stamp_s, self._rate_rps, self._turned_rad = math.nan, 0.0, 0.0
        self._differing, self._differed_at_s, self._contradicts, self._compared_s = 0, 0.0, False, math.nan
        self._difference_rad = 0.0
        self.flown = ACCEPTED
        """What is flown by: the attitude's heading, the same taken to be as before it jumped, or the position's."""

    @property
    def finding(self) -> str:
        """What is wrong with its heading, in words; empty if nothing is."""
        if self.flown == OTHER:
            degrees = math.degrees(self._difference_rad)
            return f"its ATTITUDE's yaw is {degrees:.0f}° off its positions' heading: flown by the latter"
        if self.flown == SHIFTED:
            check = self._of_attitude
            degrees = math.degrees(check.evidence_rad)
            if check.frozen:
                return "its heading doesn't turn at its yaw rate: turned at that"
            return f"its heading has jumped by {degrees:.0f}°: taken to be as before"
        return "the heading of its positions isn't its ATTITUDE's yaw: flown by the latter" if self._contradicts else ""

    def take(self, attitude: Attitude, hdg_rad: float, stamp_s: float) -> float:
        """Take the newest attitude, and the heading in the newest position, of `stamp_s`; return what is flown by.

        `hdg_rad` is NaN where the position has none.
        """
        self._turn(attitude)
        at_ns, yaw_rad, turned_rad = 1 + round(attitude.time_boot_s * 1e9), attitude.yaw_rad, self._turned_rad
        shifted_rad = self._of_attitude.take_turned(at_ns, yaw_rad, turned_rad, 0.0)
        since_s = stamp_s - attitude.time_boot_s
        carried_rad = attitude.yawspeed_radps * since_s
        if math.isnan(hdg_rad):
            self._contradicts = False
        else:
            at_ns = 1 + round(stamp_s * 1e9)
            self._of_position.take_turned(at_ns, hdg_rad, turned_rad + carried_rad, 0.0)
            if abs(since_s) <= TOGETHER_S:
                self._compare(wrap(yaw_rad + carried_rad - hdg_rad), stamp_s)
        jumped = self._of_attitude.offset_rad != 0.0
        right = not math.isnan(hdg_rad) and self._of_position.offset_rad == 0.0
        if right and self._contradicts:
            self.flown = OTHER
            return hdg_rad
        self.flown = SHIFTED if jumped else ACCEPTED
        return shifted_rad + carried_rad

    def _turn(self, attitude: Attitude) -> None:
        """Integrate its yaw rate."""
        elapsed_s = attitude.time_boot_s - self._stamp_s
        if elapsed_s == 0.0:
            return
        if not math.isnan(elapsed_s):
            self._turned_rad = wrap(self._turned_rad + (attitude.yawspeed_radps + self._rate_rps) / 2.0 * elapsed_s)
        self._stamp_s, self._rate_rps = attitude.time_boot_s, attitude.yawspeed_radps

    def _compare(self, difference_rad: float, stamp_s: float) -> None:
        """Compare the two headings at a time."""
        if stamp_s == self._compared_s:
            return
        self._compared_s = stamp_s
        if abs(difference_rad) > DIFFERENCE_RAD:
            self._differing, self._differed_at_s = self._differing + 1, stamp_s
            if self._differing >= CONFIRMED and not self._contradicts:
                self._contradicts, self._difference_rad = True, abs(difference_rad)
            return
        self._differing = 0
        if not 0.0 <= stamp_s - self._differed_at_s <= RETURNS_S:
            self._contradicts = False
