# Compiled by mypyc: it runs every tick.

"""Whether a vehicle's positions are of the time that their stamps say: shifted, frozen, late or missing ones."""

from __future__ import annotations

import math
from typing import Final

from flight_model.autopilot_model import within

SHIFT_S: Final = 0.2
"""Smallest shift of stamps that is found: positions reach a tick of the control loop up to its period late."""
SUPPORT_S: Final = 0.12
SUPPORT_SHARE: Final = 0.3
"""A shift by the position must be that of the arrival within the larger of these, and within its half."""
MIN_M: Final = 2.0
"""What a position gains on its velocity in one sample before its stamp is suspected, m."""
SIGMAS: Final = 5.0
"""The same in standard deviations of that gain, where positions are noisy."""
LATE_S: Final = 1.0
JITTERS: Final = 5.0
"""A position is late if it is older on arrival than its link's delay by this and so many standard deviations of it."""
LASTS_S: Final = 2.0
"""Positions that have been late for this long aren't flown by: the link's measured delay has had time to follow."""
RATE_MEMORY_S: Final = 3.0
RATE_S: Final = 0.25
RATE_MAX_S: Final = 0.15
"""Stamps that gain this, in sums with this memory, run at another rate; a single step adds so much at most: a jump."""
MOVES_MPS: Final = 3.0
"""A position tells how much time has passed by its velocity from this speed on."""
RETURN_S: Final = 0.1
RETURNS_S: Final = 3.0
"""Stamps run rightly again once the sum is within the first for the second."""
USUAL: Final = 0.005
"""Weight of the newest age in the usual one."""
FROZEN: Final = 3
"""So many positions that differ and have the same stamp: the stamps stand still."""


class Timing:
    """The stamps of one vehicle's positions."""

    def __init__(self) -> None:
        """Start by believing them."""
        self.shift_s = 0.0
        """What is added to the stamps."""
        self.late_s = 0.0
        """How late positions come, once they do so for long; else 0."""
        self.frozen = False
        self.noise_m2 = 0.0
        """Variance of the positions' noise, m²."""
        self.by_arrival = False
        """Whether positions are timed by their arrival: their stamps run at another rate."""
        self._gained_s, self._later_s, self._right_s, self._usual_s = 0.0, 0.0, 0.0, math.nan
        """What stamps lose on time by the positions, and by their arrival, in the sums; for how long they have been
        right; the usual age of positions."""
        self._reported_s = math.nan
        self._stamp_ns, self._arrived_ns, self._north_m, self._east_m = 0, 0, 0.0, 0.0
        self._late_since_ns, self._same = 0, 0

    @property
    def finding(self) -> str:
        """What is wrong with the stamps, in words; empty if nothing is."""
        if self.frozen:
            return "the stamps of its positions stand still"
        if self.by_arrival:
            return "its stamps run at another rate than its positions come and move: timed by arrival"
        return f"its stamps have jumped by {-self.shift_s:+.2f} s: shifted back" if self.shift_s != 0.0 else ""

    def take(
        self,
        reported_s: float,
        stamp_ns: int,
        now_ns: int,
        position_m: tuple[float, float],
        velocity_mps: tuple[float, float],
        longest_s: float,
    ) -> int:
        """Take a position's stamp; return the stamp to be used, ns.

        Args:
            reported_s: on the vehicle's clock.
            stamp_ns: on the station's clock.
            now_ns: when it is used first.
            position_m: north and east.
            velocity_mps: likewise.
            longest_s: the age to be expected at most, s.
        """
        elapsed_s = reported_s - self._reported_s  # by its own clock: the station's idea of it may change
        arrival_s = (now_ns - self._arrived_ns) * 1e-9
        moved_m = position_m[0] - self._north_m, position_m[1] - self._east_m
        if self._stamp_ns:
            repeats = reported_s == self._reported_s
            self._same = self._same + 1 if repeats and moved_m != (0.0, 0.0) else 0
            self.frozen = self._same >= FROZEN or (self.frozen and repeats)
            if not repeats and 0.0 < elapsed_s < 2.0 * LASTS_S:
                before = self.by_arrival
                self._watch_rate(elapsed_s, arrival_s, moved_m, velocity_mps)
                if before and not self.by_arrival:  # they go on from where they are now
                    shift_s = (now_ns - stamp_ns) * 1e-9 - self._usual_s
                    self.shift_s = shift_s if abs(shift_s) > SHIFT_S else 0.0
                self._shift(elapsed_s, arrival_s, moved_m, velocity_mps)
        self._reported_s, self._stamp_ns, self._arrived_ns = reported_s, stamp_ns, now_ns
        self._north_m, self._east_m = position_m
        used_ns = stamp_ns + round(self.shift_s * 1e9)
        if self.by_arrival:
            used_ns = now_ns - round(self._usual_s * 1e9)
        elif math.isnan(self._usual_s):
            self._usual_s = (now_ns - used_ns) * 1e-9
        else:
            self._usual_s += USUAL * ((now_ns - used_ns) * 1e-9 - self._usual_s)
        self._watch_age((now_ns - used_ns) * 1e-9, now_ns, longest_s)
        return used_ns

    def _watch_rate(
        self, elapsed_s: float, arrival_s: float, moved_m: tuple[float, float], velocity_mps: tuple[float, float]
    ) -> None:
        """Compare the stamps' rate with that at which positions move and come: either alone may be due to others."""
        speed2 = velocity_mps[0] * velocity_mps[0] + velocity_mps[1] * velocity_mps[1]
        kept = max(0.0, 1.0 - arrival_s / RATE_MEMORY_S)
        by_position_s = 0.0
        if speed2 >= MOVES_MPS * MOVES_MPS:
            along = moved_m[0] * velocity_mps[0] + moved_m[1] * velocity_mps[1]
            by_position_s = within(along / speed2 - elapsed_s, -RATE_MAX_S, RATE_MAX_S)
        self._gained_s = kept * self._gained_s + by_position_s
        self._later_s = kept * self._later_s + within(arrival_s - elapsed_s, -RATE_MAX_S, RATE_MAX_S)
        gained_s = abs(self._gained_s)
        if self.by_arrival:
            self._right_s = self._right_s + arrival_s if abs(self._later_s) < RETURN_S else 0.0
            if self._right_s >= RETURNS_S:
                self.by_arrival = False
        elif gained_s > RATE_S and abs(self._gained_s - self._later_s) < max(SUPPORT_S, SUPPORT_SHARE * gained_s):
            self.by_arrival, self._right_s = True, 0.0

    def _shift(
        self, elapsed_s: float, arrival_s: float, moved_m: tuple[float, float], velocity_mps: tuple[float, float]
    ) -> None:
        """Shift the stamps if a position has moved as if more or less time had passed, and came so, too."""
        speed_mps = math.hypot(*velocity_mps)
        gained_m = moved_m[0] - velocity_mps[0] * elapsed_s, moved_m[1] - velocity_mps[1] * elapsed_s
        min_m = max(MIN_M, SIGMAS * math.sqrt(2.0 * max(self.noise_m2, 0.0)))
        if speed_mps < MIN_M or math.hypot(*gained_m) < min_m:
            return
        along_m = (gained_m[0] * velocity_mps[0] + gained_m[1] * velocity_mps[1]) / speed_mps
        across_m = (gained_m[1] * velocity_mps[0] - gained_m[0] * velocity_mps[1]) / speed_mps
        shift_s, later_s = along_m / speed_mps, arrival_s - elapsed_s
        supported = abs(later_s - shift_s) < min(max(SUPPORT_S, SUPPORT_SHARE * abs(shift_s)), abs(shift_s) / 2.0)
        if abs(shift_s) > SHIFT_S and supported and abs(across_m) < SUPPORT_SHARE * abs(along_m):
            self.shift_s += shift_s
            if abs(self.shift_s) < SHIFT_S:
                self.shift_s = 0.0

    def _watch_age(self, age_s: float, now_ns: int, longest_s: float) -> None:
        if age_s <= longest_s:
            self._late_since_ns, self.late_s = 0, 0.0
            return
        self._late_since_ns = self._late_since_ns or now_ns
        if (now_ns - self._late_since_ns) * 1e-9 >= LASTS_S:
            self.late_s = age_s
