# Compiled by mypyc: it runs every tick.

"""Whether a fixed wing's heading and airspeed can be true: it turns and speeds up no faster than it can.

What has jumped is taken to be as before, and carried on by the course and the limits until it jumps back.
"""

from __future__ import annotations

import math
from typing import Final

from flight_model.autopilot_model import wrap

FASTER: Final = 1.5
JUMP_RAD: Final = 0.15
"""A heading that has turned by more than this beyond this multiple of the limit of turns has jumped. Estimates of
ArduPlanes turn by up to 0.09 rad in 0.1 s when gusts yaw them."""
SIGMAS: Final = 7.0
"""Standard deviations of the noise that are added: five, of the difference of two samples."""
GUST_MPS: Final = 4.5
"""An airspeed that has changed by more than this beyond the limit of accelerations has jumped: gusts build up over
more than a sample."""
FEWEST: Final = 20
MIN_WEIGHT: Final = 0.05
"""Steps from which on the noise is known well enough to judge, and the smallest weight of one in it."""
QUIET_S: Final = 1.0
"""What jumps again and again is carried on until it hasn't for this time."""
FROZEN: Final = 5
"""So many headings in a row that are the same to the bit are frozen, if the course turned by `JUMP_RAD` meanwhile, the
sharpest turn left out: that may be a gust."""
GAP_S: Final = 3.0


class StepNoise:
    """The noise of a quantity by its steps: what noise adds to one it takes from the next."""

    def __init__(self) -> None:
        """Start with nothing known."""
        self._variance = 0.0
        self._step = 0.0
        self._steps = 0

    @property
    def known(self) -> bool:
        """Whether enough steps have been seen."""
        return self._steps >= FEWEST

    def sigma(self, declared: float) -> float:
        """Return the standard deviation, at least the declared one."""
        return max(declared, math.sqrt(max(self._variance, 0.0)))

    def take(self, step: float) -> None:
        """Take the next step."""
        self._steps += 1
        self._variance += max(1.0 / self._steps, MIN_WEIGHT) * (0.0 - step * self._step - self._variance)
        self._step = step


class HeadingCheck:
    """The heading of one fixed wing."""

    def __init__(self, turn_max_rps: float) -> None:
        """Start by accepting it."""
        self._turn_max_rps = turn_max_rps
        self.offset_rad = 0.0
        """What is added to the heading reported."""
        self.frozen = False
        self.evidence_rad = 0.0
        """By how much it has jumped, or hasn't turned with the course."""
        self._stamp_ns, self._heading_rad, self._course_rad = 0, 0.0, 0.0
        self._noise = StepNoise()
        self._same, self._turned_rad, self._widest_rad, self._quiet_s = 0, 0.0, 0.0, QUIET_S

    def take(self, stamp_ns: int, heading_rad: float, north_mps: float, east_mps: float, sigma_rad: float) -> float:
        """Take a heading and the velocity over ground of one time; return the heading to be flown by.

        `sigma_rad`: standard deviation of the heading's noise.
        """
        return self.take_turned(stamp_ns, heading_rad, math.atan2(east_mps, north_mps), sigma_rad)

    def take_turned(self, stamp_ns: int, heading_rad: float, course_rad: float, sigma_rad: float) -> float:
        """Likewise, with a direction that should turn as the heading does in place of the velocity."""
        elapsed_s = (stamp_ns - self._stamp_ns) * 1e-9
        if self._stamp_ns and 0.0 < elapsed_s <= GAP_S:
            turned_rad, bent_rad = wrap(heading_rad - self._heading_rad), wrap(course_rad - self._course_rad)
            if self._noise.known:
                self._judge(elapsed_s, turned_rad, bent_rad, self._noise.sigma(sigma_rad))
            self._noise.take(turned_rad - bent_rad)
        if elapsed_s > 0.0:
            self._stamp_ns, self._heading_rad, self._course_rad = stamp_ns, heading_rad, course_rad
        return wrap(heading_rad + self.offset_rad) if self.offset_rad != 0.0 else heading_rad

    def _judge(self, elapsed_s: float, turned_rad: float, bent_rad: float, sigma_rad: float) -> None:
        turns_rad = max(self._turn_max_rps * elapsed_s, abs(bent_rad))
        max_rad = FASTER * turns_rad + JUMP_RAD + SIGMAS * sigma_rad
        self._quiet_s += elapsed_s
        if abs(turned_rad) > max_rad:
            self.evidence_rad, self.frozen, self._quiet_s = abs(turned_rad - bent_rad), False, 0.0
        if self._quiet_s < QUIET_S:
            self.offset_rad = wrap(self.offset_rad - turned_rad + bent_rad)
            self._same, self._turned_rad, self._widest_rad = 0, 0.0, 0.0
        elif turned_rad == 0.0:
            self._hold(bent_rad)
        else:
            if self.frozen or abs(self.offset_rad) < max_rad:
                self.offset_rad = 0.0
            self.frozen = False
            self._same, self._turned_rad, self._widest_rad = 0, 0.0, 0.0

    def _hold(self, bent_rad: float) -> None:
        """Take a heading that hasn't changed by a bit, while the course turned."""
        self._same, self._turned_rad = self._same + 1, self._turned_rad + bent_rad
        if abs(bent_rad) > abs(self._widest_rad):
            self._widest_rad = bent_rad
        if self.frozen:
            self.offset_rad = wrap(self.offset_rad + bent_rad)
        elif self._same >= FROZEN and abs(self._turned_rad - self._widest_rad) > JUMP_RAD:
            self.offset_rad = wrap(self.offset_rad + self._turned_rad)
            self.evidence_rad, self.frozen = abs(self._turned_rad), True


class AirspeedJumps:
    """The airspeed of one fixed wing."""

    def __init__(self, accel_max_mps2: float) -> None:
        """Start by accepting it."""
        self._accel_max_mps2 = accel_max_mps2
        self.offset_mps = 0.0
        """What is added to the airspeed reported."""
        self.evidence_mps = 0.0
        """By how much it jumped last."""
        self._stamp_ns, self._airspeed_mps, self._noise = 0, 0.0, StepNoise()

    def take(self, stamp_ns: int, airspeed_mps: float, sigma_mps: float, *, read: bool = True) -> float:
        """Take an airspeed; return the one to be flown by.

        `sigma_mps`: standard deviation of its noise; `read`: by the sensor, which else is taken for a failed one.
        """
        if not read:
            self.offset_mps, self._stamp_ns = 0.0, 0
            return airspeed_mps
        elapsed_s, changed_mps = (stamp_ns - self._stamp_ns) * 1e-9, airspeed_mps - self._airspeed_mps
        if self._stamp_ns and 0.0 < elapsed_s <= GAP_S:
            bound_mps = FASTER * self._accel_max_mps2 * elapsed_s + GUST_MPS
            max_mps = bound_mps + SIGMAS * self._noise.sigma(sigma_mps)
            jumps = self._noise.known and abs(changed_mps) > max_mps
            self._noise.take(changed_mps)
            if jumps:
                self.offset_mps -= changed_mps
                self.evidence_mps = abs(changed_mps)
                if abs(self.offset_mps) < max_mps:
                    self.offset_mps = 0.0
        if elapsed_s > 0.0:
            self._stamp_ns, self._airspeed_mps = stamp_ns, airspeed_mps
        return airspeed_mps + self.offset_mps if self.offset_mps != 0.0 else airspeed_mps
