# Compiled by mypyc: it runs every tick.

"""What one vehicle's telemetry says, as far as it can be true."""

from __future__ import annotations

import math
from typing import Final

from airlink.clock import LONG_AGO, NANOSECONDS, Instant, seconds_between
from flight_model.autopilot_model import AutopilotModel, within
from flight_model.flight_state import FlightState
from flight_model.slot import Vector3
from gcs_formation.estimation.sample import Sample
from gcs_formation.estimation.vehicle_filter import VehicleFilter
from gcs_formation.features.telemetry_health.commanded_velocity import CommandedVelocity
from gcs_formation.features.telemetry_health.consistency import POSITION, VELOCITY, Consistency
from gcs_formation.features.telemetry_health.estimator_report import EstimatorReport
from gcs_formation.features.telemetry_health.heading_and_airspeed import AirspeedJumps, HeadingCheck
from gcs_formation.features.telemetry_health.nose import ACCEPTED, NoseCheck
from gcs_formation.features.telemetry_health.timing import JITTERS, LATE_S, Timing
from gcs_formation.vehicle.vehicle import Vehicle
from gcs_formation.vehicle.velocity_setpoint import ground_motion

UNKNOWN: Final = math.nan
DISPLACED_MAX_M: Final = 30.0
"""A vehicle that is displaced by more, by what it says, doesn't fly in the formation: which of the two is true matters
too much to guess, m."""
FASTER: Final = 1.5
WIND_MPS: Final = 20.0
RISES_MPS: Final = 10.0
"""An aircraft doesn't move faster than this multiple of its limit and this wind, or rise or sink of the air."""
AGAIN_S: Final = 3.0
"""What goes on is said again, and what is over is said, after this time, s."""
HORIZONTAL: Final = ("position", "velocity")
VERTICAL: Final = ("height", "velocity")


class Commanded:
    """What a vehicle is commanded to do."""

    def __init__(self, height_m: float, acting: Vector3, *, stops: bool) -> None:
        """Take it.

        Args:
            height_m: commanded last, NaN if none is.
            acting: of a multirotor: speed, heading and height that act at its newest sample, NaN if none do.
            stops: whether it was commanded to loiter.
        """
        self.height_m, self.acting, self.stops = height_m, acting, stops


class VehicleHealth:
    """One vehicle's position and height, each with its rate, its heading, and the stamps of all these."""

    def __init__(self, vehicle: Vehicle, model: AutopilotModel) -> None:
        """Start by believing everything; the model has the limits of its speeds."""
        self.vehicle, self._model = vehicle, model
        self._reported: dict[str, tuple[str, Instant, Instant]] = {}
        """The quantities that aren't accepted, in which words that was said and when, and when they last weren't."""
        self.begin()

    stacked: bool = False
    """Whether some slots are separated by their heights alone; else a height that is only known by its climb rate is no
    reason to leave: the others are to the side."""

    def begin(self) -> None:
        """Reset, as after a restart."""
        model = self._model
        self._across = Consistency(2, FASTER * model.speed_max_mps + WIND_MPS)
        self._up = Consistency(1, FASTER * model.climb_max_mps + RISES_MPS)
        self._heading, self._timing = HeadingCheck(model.turn_rate_max_rps), Timing()
        self._nose = NoseCheck(model.turn_rate_max_rps)
        self._airspeed, self._wind = AirspeedJumps(model.accel_max_mps2), (UNKNOWN, UNKNOWN)
        self._commanded, self._estimator = CommandedVelocity(model), EstimatorReport()

    def examine(
        self, sample: Sample, known: VehicleFilter, commanded: Commanded, now: Instant, *, leads: bool
    ) -> Sample:
        """Return what is to be flown by: the sample itself, or a copy without what can't be true."""
        vehicle, noise = self.vehicle, known.noise.by_quantity
        self._estimator.take(vehicle.telemetry, now)
        north_m, east_m, up_m = vehicle.telemetry.displaced_m
        position_m, velocity_mps = (
            (sample.north_m - north_m, sample.east_m - east_m),
            (sample.north_mps, sample.east_mps),
        )
        height_m = sample.height_m - up_m
        motion = vehicle.telemetry.motion
        reported_s = UNKNOWN if motion is None else motion.stamp_s
        stamp = self._stamp(sample, reported_s, now, position_m, velocity_mps)
        if self._timing.frozen or math.isnan(reported_s):
            return sample
        own = 1 + round((reported_s + self._timing.shift_s) * NANOSECONDS)
        at = stamp if self._timing.by_arrival else own
        airspeed_mps, heading_rad = sample.airspeed_mps, sample.heading_rad
        if not vehicle.telemetry.hovers:
            check = vehicle.sampler.airspeed_check
            read = check is None or check.accepted
            airspeed_mps = self._airspeed.take(own, airspeed_mps, math.sqrt(noise[4]), read=read)
            heading_rad = self._heading.take(own, heading_rad, *velocity_mps, math.sqrt(noise[5]))
            witness = self._by_air(airspeed_mps, heading_rad, known.state)
        else:
            witness = self._commanded.take(own, commanded.acting, velocity_mps, stops=commanded.stops)
            airspeed_mps, heading_rad = self._over_ground(sample, leads=leads)
        across = self._across.take(at, list(position_m), list(velocity_mps), witness, (noise[0], noise[2]))
        self._up.doubts_velocity = self._across.wrong == VELOCITY
        climb_mps = self._climb_mps(commanded.height_m - height_m - self._up.axes[0].offset_m)
        up = self._up.take(at, [height_m], [sample.climb_mps], [climb_mps], (noise[1], noise[3]))
        unchanged = airspeed_mps == sample.airspeed_mps and heading_rad == sample.heading_rad and stamp == sample.stamp
        if unchanged and not across and not up and vehicle.telemetry.displaced_m == (0.0, 0.0, 0.0):
            return sample
        north, east = self._across.axes
        vehicle.telemetry.displaced_m = north.offset_m, east.offset_m, self._up.axes[0].offset_m
        return self._corrected(sample, Instant(stamp), airspeed_mps, heading_rad, leads=leads)

    def _stamp(
        self, sample: Sample, reported_s: float, now: Instant, position_m: tuple[float, float], mps: tuple[float, float]
    ) -> int:
        """Return the stamp to be used of a sample, stamped at `reported_s` by its own clock."""
        timing, before, vehicle = self._timing, self._timing.by_arrival, self.vehicle
        longest_s = vehicle.clock.one_way_s + LATE_S + JITTERS * vehicle.jitter.jitter_s
        attitude = vehicle.telemetry.attitude
        if attitude is not None and attitude.time_boot_s - reported_s <= LATE_S:
            longest_s = math.inf  # all that it says is as old: its clock or the link is slower than was measured
        north, east = self._across.axes
        timing.noise_m2 = max(north.noise_m2, east.noise_m2)
        stamp = timing.take(reported_s, int(sample.stamp), int(now), position_m, mps, longest_s)
        if timing.by_arrival != before:  # what was found meanwhile was due to the stamps
            self._across.forget()
            self._up.forget()
        return stamp

    def _over_ground(self, sample: Sample, *, leads: bool) -> tuple[float, float]:
        """Return a multirotor's ground speed and course (a leader's axis): the sample's if its heading can be true."""
        attitude, motion = self.vehicle.telemetry.attitude, self.vehicle.telemetry.motion
        if attitude is None or motion is None:
            return sample.airspeed_mps, sample.heading_rad
        nose_rad = self._nose.take(attitude, motion.heading_rad, motion.stamp_s)
        if self._nose.flown == ACCEPTED:
            return sample.airspeed_mps, sample.heading_rad
        return ground_motion(nose_rad, sample.north_mps, sample.east_mps, leads=leads)

    def _by_air(self, airspeed_mps: float, heading_rad: float, known: FlightState | None) -> list[float]:
        """Return the velocity over ground by airspeed, heading and wind; NaN while that isn't known.

        While the velocity isn't accepted the wind is the one before: the present one is estimated from what is flown.
        """
        if self._across.wrong is None:
            self._wind = _wind_mps(known)
        north_mps, east_mps = self._wind
        return [airspeed_mps * math.cos(heading_rad) + north_mps, airspeed_mps * math.sin(heading_rad) + east_mps]

    def _climb_mps(self, below_m: float) -> float:
        """Return the climb to a commanded height from so far below it; NaN if there is none."""
        model = self._model
        return within(below_m / (model.tau_ha_s + model.tau_hb_s), -model.climb_max_mps, model.climb_max_mps)

    def _corrected(
        self, sample: Sample, stamp: Instant, airspeed_mps: float, heading_rad: float, *, leads: bool
    ) -> Sample:
        north, east, up = *self._across.axes, self._up.axes[0]
        if self.vehicle.telemetry.hovers:
            airspeed_mps, heading_rad = ground_motion(heading_rad, north.flown_mps, east.flown_mps, leads=leads)
        return Sample(
            stamp,
            north.flown_m,
            east.flown_m,
            up.flown_m,
            north.flown_mps,
            east.flown_mps,
            up.flown_mps,
            airspeed_mps,
            heading_rad,
            by_course=sample.by_course,
            airspeed_ratio=sample.airspeed_ratio,
        )

    @property
    def height_unknown(self) -> bool:
        """Whether its height is known by its climb rate alone."""
        return self._up.wrong == POSITION

    @property
    def unfit(self) -> str:
        """Return why the vehicle can't fly in the formation; empty if it can."""
        for found, (quantity, _) in ((self._across, HORIZONTAL), (self._up, VERTICAL)):
            if found.wrong == POSITION and found.lasts and (quantity == HORIZONTAL[0] or self.stacked):
                return f"its {quantity} doesn't move by its velocity"
            if found.wrong is None and found.displaced_m > DISPLACED_MAX_M:
                return f"its {quantity} has jumped by {found.displaced_m:.0f} m"
        if self._estimator.lost:
            return "its estimator has no absolute position"
        if self._timing.frozen:
            return "the stamps of its positions stand still"
        return f"its positions come {self._timing.late_s:.1f} s late" if self._timing.late_s else ""

    def changes(self, now: Instant) -> list[tuple[str, bool, str]]:
        """Return what has changed since the last call: quantity, whether it is healthy, and the evidence in words.

        What goes on is said again, in other words, after `AGAIN_S`; that it is over once it has been for as long.
        """
        found = self._findings()
        if not found and not self._reported:
            return []
        new = list[tuple[str, bool, str]]()
        for quantity, text in found.items():
            words, reported_at, _ = self._reported.get(quantity, ("", LONG_AGO, now))
            if text != words and seconds_between(reported_at, now) > AGAIN_S:
                new.append((quantity, False, text))
                words, reported_at = text, now
            self._reported[quantity] = words, reported_at, now
        for quantity, (_, _, last) in list(self._reported.items()):
            if seconds_between(last, now) > AGAIN_S:
                del self._reported[quantity]
                new.append((quantity, True, f"{quantity}: believed again"))
        return new

    def _findings(self) -> dict[str, str]:
        """Return the quantities that aren't accepted, with the evidence."""
        found, seen = self._of_positions(), self.vehicle.telemetry
        self._add_of_others(found)
        stamps = self._timing.finding
        if stamps:
            found["stamps"] = stamps
        if self._timing.late_s:
            found.setdefault("position", "its positions come late: not flown by")
        for quantity, text in self._estimator.findings().items():
            found.setdefault(quantity, text)
        lacking = seen.lacking
        if lacking:
            found.setdefault(lacking, f"it tells no {lacking} any more")
        return found

    def _of_positions(self) -> dict[str, str]:
        found = dict[str, str]()
        for each, names in ((self._across, HORIZONTAL), (self._up, VERTICAL)):
            if each.wrong is not None:
                instead = "carried on by its velocity" if each.wrong == POSITION else f"that of its {names[0]} is flown"
                words = f"its {names[0]} moved {each.evidence_m:.1f} m otherwise than its velocity says"
                found[names[each.wrong]] = f"{words}: {names[each.wrong]} not believed, {instead}"
            elif each.displaced_m > 0.0:
                switch = f" ('{self._estimator.switched}')" if self._estimator.switched else ""
                jumped = f"its {names[0]} has jumped by {each.displaced_m:.1f} m{switch}"
                found[names[0]] = f"{jumped}: taken to be where it was"
            elif each.is_noisy:
                found[names[0]] = f"its {names[0]} scatters by {each.sigma_m:.0f} m or more: smoothed"
        return found

    def _add_of_others(self, found: dict[str, str]) -> None:
        seen = self.vehicle.telemetry
        if self._heading.frozen:
            found["attitude"] = "its heading doesn't turn with its course: turned with it"
        elif self._heading.offset_rad != 0.0:
            degrees = math.degrees(self._heading.evidence_rad)
            found["attitude"] = f"its heading has jumped by {degrees:.0f}°: taken to be as before"
        if self._nose.finding:
            found["attitude"] = self._nose.finding
        if seen.not_finite:
            found["attitude"] = f"{seen.not_finite}: flown without"
        if self._airspeed.offset_mps != 0.0:
            jumped = f"its airspeed has jumped by {self._airspeed.evidence_mps:.1f} m/s"
            found["airspeed"] = f"{jumped}: taken to be as before"


def _wind_mps(known: FlightState | None) -> tuple[float, float]:
    return (UNKNOWN, UNKNOWN) if known is None else (known.wind_north_mps, known.wind_east_mps)
