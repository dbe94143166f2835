"""One vehicle's motion as telemetry reports it, its autopilot's targets, and how planes take off and land.

Source of take-offs: ArduPlane 4.7's and PX4 1.17's simulated planes (docs/real-autopilots.md). One whose scenario names
no aircraft rolls and climbs by equation (7) and its limits.
"""

from __future__ import annotations

import math
from typing import Final, NamedTuple

from mypy_extensions import mypyc_attr

from flight_model.autopilot_model import AutopilotModel, FlightState, crab_rad, within
from formation_scenario.vehicles import VehicleModel

HEADING: Final = 0
COURSE: Final = 1
CIRCLE: Final = 2
CAPTURE: Final = 2.0
"""Steepness of the approach to a circle: radians off the tangent per radius of distance from it."""
ON_CIRCLE_RAD: Final = 1.0
"""Closer to the tangent than this, the heading setpoint leads by the heading's lag in the turn."""
LEAST_SPEED_MPS: Final = 1.0
"""Lower bound of airspeeds in divisions, for vehicles that stand still."""
LIFT_OFF_SHARE: Final = 0.7
"""Share of the lowest airspeed at which a vehicle lifts off."""
AIRFRAMES_SHARE: Final = 0.88
"""The same of an airframe's cruising airspeed: an ArduPlane pitches up 3.7 s after arming, at 19 to 20 m/s."""
PX4S_SHARE: Final = 0.8
"""The same of a PX4's highest airspeed: 16 m/s, 2.4 s after arming."""
PX4S_CLIMB_SHARE: Final = 0.9
"""Share of its highest airspeed at which a PX4 climbs with full throttle: 18 m/s."""
LINED_UP_RAD: Final = math.radians(10.0)
AT_HEIGHT_M: Final = 3.0
LOOK_AHEAD_M: Final = 60.0
"""Look-ahead distance along the approach line, from abreast of the vehicle."""
BELOW_GROUND_M: Final = 3.0
"""How far below the ground the glide slope is continued, because the height lags."""
PX4S_ACCEL_MPS2, PX4S_LAG_S, PX4S_CLIMB_MPS = 8.0, 0.5, 4.9


class InnovationRatios(NamedTuple):
    """The newest innovations as shares of what the filter accepts, which EKF_STATUS_REPORT calls variances."""

    velocity: float = 0.02
    horizontal: float = 0.02
    height: float = 0.02
    compass: float = 0.01


USUAL = InnovationRatios()


class Estimate:
    """The estimate at one sample."""

    def __init__(
        self,
        received: Motion | None,
        pitch_error_rad: float = 0.0,
        bank_error_rad: float = 0.0,
        unknown: int = 0,
        ratios: InnovationRatios = USUAL,
    ) -> None:
        """Take the motion by the GNSS receiver (None: without a fix), errors of attitude, and what the filter says.

        `unknown`: bits of EKF_STATUS_FLAGS, which of its estimates are too uncertain to be called good.
        """
        self.received = received
        self.pitch_error_rad = pitch_error_rad
        self.bank_error_rad = bank_error_rad
        self.unknown = unknown
        self.ratios = ratios


@mypyc_attr(acyclic=True, free_list_len=1)
class Motion:
    """NED from the fleet's origin, heights upwards; airspeed and heading are air-relative; headings aren't wrapped."""

    def __init__(  # noqa: PLR0913, PLR0917 - a state and its targets
        self,
        north_m: float,
        east_m: float,
        height_m: float,
        climb_mps: float,
        airspeed_mps: float,
        heading_rad: float,
        velocity_north_mps: float,
        velocity_east_mps: float,
        velocity_down_mps: float,
        drift_north_mps: float,
        drift_east_mps: float,
        drift_down_mps: float,
        turn_rate_radps: float,
        airspeed_setpoint_mps: float,
        heading_setpoint_rad: float,
        height_setpoint_m: float,
    ) -> None:
        """Take place, motion through the air and over ground, what carries it, its turn, and its targets."""
        self.north_m = north_m
        self.east_m = east_m
        self.height_m = height_m
        self.climb_mps = climb_mps
        self.airspeed_mps = airspeed_mps
        self.heading_rad = heading_rad
        self.velocity_north_mps = velocity_north_mps
        self.velocity_east_mps = velocity_east_mps
        self.velocity_down_mps = velocity_down_mps
        self.drift_north_mps = drift_north_mps
        self.drift_east_mps = drift_east_mps
        self.drift_down_mps = drift_down_mps
        self.turn_rate_radps = turn_rate_radps
        self.airspeed_setpoint_mps = airspeed_setpoint_mps
        self.heading_setpoint_rad = heading_setpoint_rad
        self.height_setpoint_m = height_setpoint_m

    def copy(self) -> Motion:
        """Return the same motion as an object of its own."""
        return Motion(
            self.north_m,
            self.east_m,
            self.height_m,
            self.climb_mps,
            self.airspeed_mps,
            self.heading_rad,
            self.velocity_north_mps,
            self.velocity_east_mps,
            self.velocity_down_mps,
            self.drift_north_mps,
            self.drift_east_mps,
            self.drift_down_mps,
            self.turn_rate_radps,
            self.airspeed_setpoint_mps,
            self.heading_setpoint_rad,
            self.height_setpoint_m,
        )


def with_drift(sensed: Motion) -> Motion:
    """Return it with the drift as the vehicle estimates it: ground velocity minus airspeed along the heading."""
    sensed.drift_north_mps = sensed.velocity_north_mps - sensed.airspeed_mps * math.cos(sensed.heading_rad)
    sensed.drift_east_mps = sensed.velocity_east_mps - sensed.airspeed_mps * math.sin(sensed.heading_rad)
    return sensed


class Steering:
    """One vehicle's targets. Its modes write them; every cycle of the main loop reads them."""

    def __init__(self) -> None:
        """Start at rest."""
        self.kind: int = HEADING
        self.speed_mps: float = 0.0
        self.accel_mps2: float = math.inf
        self.direction_rad: float = 0.0
        """Heading or course, as `kind` says."""
        self.lateral_mps2: float = math.inf
        self.height_m: float = 0.0
        self.centre_north_m: float = 0.0
        self.centre_east_m: float = 0.0
        self.radius_m: float = 1.0
        """Of the circle; negative: anticlockwise."""
        self.stopped: bool = True
        """Throttle at 0."""
        self.takes_off: bool = False
        """Whether it takes off from the ground: it rolls, or climbs to where its take-off ends."""
        self.airborne: bool = False
        self.velocity_mps: tuple[float, float, float] = (0.0, 0.0, 0.0)
        """Over ground, north, east and down: what a multirotor is commanded."""
        self.yaw_rad: float = math.nan
        """Where its nose shall point; NaN: as it does."""

    def heading_rad(self, state: FlightState, tau_psi_s: float) -> float:
        """Return the heading to fly now, in the air that carries `state`; `tau_psi_s` is the heading's lag."""
        if self.kind == HEADING:
            return self.direction_rad
        course_rad = self._round(state, tau_psi_s) if self.kind == CIRCLE else self.direction_rad
        return course_rad - crab_rad(state, course_rad)

    def _round(self, state: FlightState, tau_psi_s: float) -> float:
        """Return the course that leads onto the circle and along it: clockwise, of a negative radius the other way."""
        north_m, east_m = state.north_m - self.centre_north_m, state.east_m - self.centre_east_m
        side = 1.0 if self.radius_m > 0.0 else -1.0
        off_rad = CAPTURE * (math.hypot(north_m, east_m) / abs(self.radius_m) - 1.0)
        off_rad = within(off_rad, -math.pi / 2.0, math.pi / 2.0)
        course_rad = math.atan2(east_m, north_m) + side * (math.pi / 2.0 + off_rad)
        if abs(off_rad) < ON_CIRCLE_RAD:
            course_rad += tau_psi_s * state.airspeed_mps / self.radius_m
        return course_rad


class Approach(NamedTuple):
    """The final approach to home: the touch-down point, the direction, and the length and height at its start."""

    north_m: float
    east_m: float
    direction_rad: float
    length_m: float
    height_m: float
    lead_m: float
    """Distance by which the height setpoint leads the glide slope, to make up for the height's lag."""

    @property
    def begin_m(self) -> tuple[float, float]:
        """Where it begins, north and east."""
        cos, sin = math.cos(self.direction_rad), math.sin(self.direction_rad)
        return self.north_m - self.length_m * cos, self.east_m - self.length_m * sin

    def circle(self, radius_m: float) -> tuple[float, float]:
        """Return the centre, north and east, m, of the circle tangent to the approach at its start.

        `radius_m`: negative of an anticlockwise one.
        """
        north_m, east_m = self.begin_m
        return north_m - radius_m * math.sin(self.direction_rad), east_m + radius_m * math.cos(self.direction_rad)

    def begins(self, motion: Motion) -> bool:
        """Return whether a vehicle on that circle is low enough and aligned with the approach."""
        course_rad = math.atan2(motion.velocity_east_mps, motion.velocity_north_mps)
        off_rad = math.remainder(course_rad - self.direction_rad, math.tau)
        low = abs(motion.height_m - self.height_m) < AT_HEIGHT_M
        return low and abs(off_rad) < LINED_UP_RAD and abs(self._aside_m(motion)) < LOOK_AHEAD_M

    def guide(self, motion: Motion) -> tuple[float, float]:
        """Return the course back to the approach line, rad, and the height of the glide slope, m."""
        share = (self._to_go_m(motion) - self.lead_m) / self.length_m
        course_rad = self.direction_rad - math.atan(self._aside_m(motion) / LOOK_AHEAD_M)
        return course_rad, max(share * self.height_m, -BELOW_GROUND_M)

    def _to_go_m(self, motion: Motion) -> float:
        north_m, east_m = self.north_m - motion.north_m, self.east_m - motion.east_m
        return north_m * math.cos(self.direction_rad) + east_m * math.sin(self.direction_rad)

    def _aside_m(self, motion: Motion) -> float:
        """Return how far right of the line it is."""
        north_m, east_m = motion.north_m - self.north_m, motion.east_m - self.east_m
        return east_m * math.cos(self.direction_rad) - north_m * math.sin(self.direction_rad)


def lift_off_mps(model: VehicleModel) -> float:
    """Return the airspeed at which a fixed wing leaves the ground."""
    if model.airframe is not None:
        return AIRFRAMES_SHARE * model.airframe.airspeed_cruise_mps
    if model.firmware == "px4":
        return PX4S_SHARE * model.speed_max_mps
    return LIFT_OFF_SHARE * model.speed_min_mps


def full_throttle_model(model: VehicleModel) -> AutopilotModel | None:
    """Return by what a PX4 without an airframe takes off, whose highest airspeed it keeps; None for all others."""
    if model.firmware != "px4" or model.airframe is not None:
        return None
    climbs = model.autopilot()
    climbs.tau_v_s, climbs.accel_max_mps2, climbs.climb_max_mps = PX4S_LAG_S, PX4S_ACCEL_MPS2, PX4S_CLIMB_MPS
    climbs.speed_max_mps *= PX4S_CLIMB_SHARE
    return climbs
