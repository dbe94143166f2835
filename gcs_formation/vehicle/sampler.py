"""Turns a vehicle's telemetry into samples of its state: each once, on the station's clock, if plausible."""

from __future__ import annotations

import math
from typing import Final

from airlink.clock import NANOSECONDS, Instant, seconds_between
from airlink.messages.telemetry import Attitude
from flight_model.autopilot_model import wrap
from flight_model.flight_state import FlightState
from gcs_formation.estimation.airspeed import AirspeedCheck
from gcs_formation.estimation.sample import Sample
from gcs_formation.link.frame_history import EARLY_S, LONGEST_DELAY_S
from gcs_formation.link.round_trips import RoundTrips
from gcs_formation.link.source_binding import SourceBinding
from gcs_formation.vehicle.autopilot_family import Autopilot
from gcs_formation.vehicle.reported_motion import ReportedMotion
from gcs_formation.vehicle.telemetry import Telemetry
from gcs_formation.vehicle.velocity_setpoint import ground_motion

TOGETHER_S: Final = 0.02
"""Attitude and position whose stamps differ by no more are of one time, s."""
EXTRAPOLATED_RAD: Final = 0.1
"""Largest error of an extrapolated heading: a turn of 0.5 rad/s that has begun since."""
EXTRAPOLATED_S: Final = 2.0
"""Largest age of a position that is extrapolated to now, s; an older one tells nothing of the present position."""


class Sampler:
    """Makes samples from one vehicle's telemetry."""

    def __init__(
        self,
        telemetry: Telemetry,
        autopilot: Autopilot,
        round_trips: RoundTrips,
        source_binding: SourceBinding,
        airspeed_check: AirspeedCheck | None,
    ) -> None:
        """Start without samples; `airspeed_check`: decides whether a fixed wing's airspeeds are plausible."""
        self._telemetry, self._autopilot, self._round_trips = telemetry, autopilot, round_trips
        self._source_binding, self.airspeed_check = source_binding, airspeed_check
        self._sampled: ReportedMotion | None = None
        self._by_course = autopilot.flies_courses
        self.refused = False
        """Whether the newest position was rejected: it isn't recent, or attitude and airspeed are of another time."""

    def see(self, round_trips: RoundTrips, source_binding: SourceBinding) -> None:
        """Map stamps by what is known on another of the vehicle's links from now on."""
        self._round_trips, self._source_binding = round_trips, source_binding

    def restart(self) -> None:
        """Forget what earlier readings showed: the vehicle has restarted."""
        if self.airspeed_check is not None:
            self.airspeed_check.restart()

    def new(self, now: Instant, *, flew: bool, leads: bool = False) -> Sample | None:
        """Return the newest sample, once; None while the vehicle's clock is unknown.

        The heading is that of the attitude, at the position's time. A multirotor's airspeed and heading are those
        of its ground velocity. `flew`: it flies, or did when last received; readings on the ground before that aren't
        learned from. `leads`: other vehicles' slots depend on its motion.
        """
        seen = self._telemetry
        if seen.motion is None or seen.attitude is None or not seen.complete or not self._round_trips.clock.samples:
            return None
        motion, attitude = seen.motion, seen.attitude
        if motion is self._sampled:
            return None
        self._sampled = motion
        stamp = self._round_trips.stamps.to_instant(motion.stamp_s)
        self.refused = not _is_of(now, stamp) or not seen.of_one_time
        if self.refused:
            self._telemetry.implausible += 1
            return None
        heading_rad = _heading_rad(motion, attitude)
        airspeed_mps = self._airspeed(motion, heading_rad, flew=flew)
        if seen.hovers:
            airspeed_mps, heading_rad = ground_motion(heading_rad, motion.north_mps, motion.east_mps, leads=leads)
        return Sample(
            stamp,
            motion.north_m,
            motion.east_m,
            motion.height_m,
            motion.north_mps,
            motion.east_mps,
            motion.climb_mps,
            airspeed_mps,
            heading_rad,
            by_course=self._by_course,
            airspeed_ratio=self._autopilot.true_airspeed(1.0),
        )

    def extrapolated(self, now: Instant) -> tuple[FlightState, float] | None:
        """Return the state extrapolated from its newest position to `now`, and the position's age, s.

        Velocity and, for a fixed wing, turn rate are held constant. The position is NaN if the age exceeds
        `EXTRAPOLATED_S`; the wind is always NaN. None before the first position, or while the clock is unknown.
        """
        motion, attitude = self._telemetry.motion, self._telemetry.attitude
        if motion is None or not self._round_trips.clock.samples:
            return None
        age_s = seconds_between(self._round_trips.clock.to_instant(motion.stamp_s), now)
        for_s = age_s if age_s <= EXTRAPOLATED_S else math.nan
        turn_radps = attitude.yawspeed_radps if attitude is not None else 0.0
        heading_rad = attitude.yaw_rad + turn_radps * for_s if attitude is not None else math.nan
        half_rad = 0.0 if self._telemetry.hovers else turn_radps * for_s / 2.0
        # An arc's chord is turned by half of the arc's angle, and is shorter by sin(half)/half.
        cos, sin = math.cos(half_rad), math.sin(half_rad)
        chord_s = for_s * sin / half_rad if half_rad else for_s
        state = FlightState(
            motion.north_m + chord_s * (motion.north_mps * cos - motion.east_mps * sin),
            motion.east_m + chord_s * (motion.north_mps * sin + motion.east_mps * cos),
            motion.height_m + for_s * motion.climb_mps,
            motion.climb_mps,
            self.airspeed_mps,
            heading_rad,
            math.nan,
            math.nan,
        )
        return state, age_s

    def why_unknown(self, now: Instant) -> str | None:
        """Return in words why its telemetry gives no present state; None if it does, or before the first message."""
        if not self._round_trips.clock.samples:
            return "it answers no TIMESYNC: its delay and clock aren't known"
        seen, stamp_s = self._telemetry, self._source_binding.refused_stamp_s
        if seen.motion is not None and _is_of(now, self._round_trips.stamps.to_instant(seen.motion.stamp_s)):
            if math.isnan(seen.airspeed_mps):
                return "it has reported no airspeed in VFR_HUD"
            if seen.not_finite:
                return f"it tells no attitude: {seen.not_finite}"
            together = seen.attitude is None or seen.of_one_time
            return None if together else "its position, attitude and airspeed aren't of one time"
        if math.isnan(stamp_s) and seen.motion is not None:
            stamp_s = seen.motion.stamp_s
        if math.isnan(stamp_s):
            return None
        times = f"{now / NANOSECONDS + self._round_trips.clock.offset_s:.0f} s, where the newest is of {stamp_s:.0f} s"
        return f"its TIMESYNC tells another time than the stamps of its positions: {times}"

    @property
    def airspeed_mps(self) -> float:
        """Newest true airspeed; NaN before the first."""
        return self._autopilot.true_airspeed(self._telemetry.airspeed_mps)

    def _airspeed(self, motion: ReportedMotion, heading_rad: float, *, flew: bool) -> float:
        """Return the true airspeed, m/s, synthetic if the sensor fails its check; in the air, update the scale."""
        scale, check, ias_mps = self._autopilot.airspeed_scale, self.airspeed_check, self._telemetry.airspeed_mps
        if check is not None and flew:
            ratio = self._autopilot.true_airspeed(1.0)
            if not check.accepts(motion.stamp_s, motion.north_mps, motion.east_mps, heading_rad, ias_mps, ratio):
                return check.synthetic_mps
        if scale is not None and flew:
            velocity_mps = motion.north_mps, motion.east_mps, motion.climb_mps
            above_sea_m = motion.height_m + self._autopilot.origin.alt_m
            scale.update(motion.stamp_s, above_sea_m, velocity_mps, ias_mps, heading_rad)
        return self.airspeed_mps


def _heading_rad(motion: ReportedMotion, attitude: Attitude) -> float:
    """Return the heading at a position's time: the attitude's, extrapolated by its turn rate if it is of another time.

    Attitudes come more rarely than positions, which have a heading too, rounded to 0.01 degrees: it replaces what is
    extrapolated, unless it is unknown or contradicts it.
    """
    since_s = motion.stamp_s - attitude.time_boot_s
    heading_rad = attitude.yaw_rad + attitude.yawspeed_radps * since_s
    off_rad = wrap(motion.heading_rad - heading_rad)
    return heading_rad + off_rad if abs(since_s) > TOGETHER_S and abs(off_rad) < EXTRAPOLATED_RAD else heading_rad


def _is_of(now: Instant, stamp: Instant) -> bool:
    """Return whether a message stamped at an instant can have just arrived."""
    return -EARLY_S <= seconds_between(stamp, now) <= LONGEST_DELAY_S
