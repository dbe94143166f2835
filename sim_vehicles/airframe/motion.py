"""One vehicle's motion in telemetry, its autopilot's targets, and take-off and landing of planes.

Source of take-offs: simulated planes of ArduPlane 4.7 and PX4 1.17 (docs/real-autopilots.md). A vehicle without an
aircraft in the scenario rolls and climbs by equation (7) and its limits.
"""

from __future__ import annotations

import math
from typing import Final, NamedTuple

from mypy_extensions import mypyc_attr

from flight_model.autopilot_model import AutopilotModel, crab_rad, rotated, within
from flight_model.flight_state import FlightState
from formation_scenario.vehicles import VehicleModel

HEADING: Final = 0
COURSE: Final = 1
CIRCLE: Final = 2
CAPTURE: Final = 2.0
"""Gain of the approach to a circle: radians off the tangent per radius of distance from it."""
ON_CIRCLE_RAD: Final = 1.0
"""Angle off the tangent below which the heading setpoint leads by the heading's delay in the turn."""
MIN_SPEED_MPS: Final = 1.0
"""Lower bound of airspeed in divisions, for vehicles at rest."""
LIFT_OFF_SHARE: Final = 0.7
"""Lift-off airspeed as a share of the lowest airspeed."""
AIRFRAMES_SHARE: Final = 0.88
"""The same as a share of an airframe's cruising airspeed: ArduPlane pitches up 3.7 s after arming, at 19 to 20 m/s."""
PX4S_SHARE: Final = 0.8
"""The same as a share of PX4's highest airspeed: 16 m/s, 2.4 s after arming."""
PX4S_CLIMB_SHARE: Final = 0.9
"""Airspeed of PX4's climb with full throttle as a share of its highest airspeed: 18 m/s."""
LINED_UP_RAD: Final = math.radians(10.0)
AT_HEIGHT_M: Final = 3.0
LOOK_AHEAD_M: Final = 60.0
"""Look-ahead distance along the approach line, from abreast of the vehicle."""
BELOW_GROUND_M: Final = 3.0
"""Depth below the ground to which the glide slope is continued, because the height is delayed."""
Vector = tuple[float, float, float]
PX4S_ACCEL_MPS2, PX4S_TAU_S, PX4S_CLIMB_MPS = 8.0, 0.5, 4.9


class InnovationRatios(NamedTuple):
    """The newest innovations as shares of the filter's gates, which EKF_STATUS_REPORT calls variances."""

    velocity: float = 0.02
    horizontal: float = 0.02
    height: float = 0.02
    compass: float = 0.01


USUAL = InnovationRatios()


class Estimate:
    """The navigation estimate at one sample."""

    def __init__(
        self,
        received: Motion | None,
        pitch_error_rad: float = 0.0,
        bank_error_rad: float = 0.0,
        unknown: int = 0,
        ratios: InnovationRatios = USUAL,
    ) -> None:
        """Take the motion measured by the GNSS receiver (None: no fix), attitude errors, and the filter's status.

        `unknown`: bits of EKF_STATUS_FLAGS whose estimates are too uncertain to be valid.
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
        """Take position, motion through the air and over ground, the air's velocity, turn rate, and targets."""
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
        self.yaw_rate_radps = turn_rate_radps
        """Of the nose; a multirotor's isn't that of its course."""
        self.airspeed_setpoint_mps = airspeed_setpoint_mps
        self.heading_setpoint_rad = heading_setpoint_rad
        self.height_setpoint_m = height_setpoint_m

    def copy(self) -> Motion:
        """Return a copy."""
        copied = Motion(
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
        copied.yaw_rate_radps = self.yaw_rate_radps
        return copied


def with_drift(sensed: Motion) -> Motion:
    """Return the motion with the drift that the vehicle estimates: ground velocity minus airspeed along the heading."""
    sensed.drift_north_mps = sensed.velocity_north_mps - sensed.airspeed_mps * math.cos(sensed.heading_rad)
    sensed.drift_east_mps = sensed.velocity_east_mps - sensed.airspeed_mps * math.sin(sensed.heading_rad)
    return sensed


class Steering:
    """One vehicle's targets. Its modes write them, and every cycle of the main loop reads them."""

    def __init__(self) -> None:
        """Start at rest."""
        self.kind: int = HEADING
        self.speed_mps: float = 0.0
        self.accel_mps2: float = math.inf
        self.direction_rad: float = 0.0
        """Heading or course, by `kind`."""
        self.lateral_mps2: float = math.inf
        self.height_m: float = 0.0
        self.centre_north_m: float = 0.0
        self.centre_east_m: float = 0.0
        self.radius_m: float = 1.0
        """Radius of the circle; negative: anticlockwise."""
        self.stopped: bool = True
        """Whether the throttle is 0."""
        self.takes_off: bool = False
        """Whether it takes off: it rolls, or climbs to the end of the take-off."""
        self.airborne: bool = False
        self.velocity_mps: Vector = (0.0, 0.0, 0.0)
        """A multirotor's ground velocity setpoint: north, east and down."""
        self.yaw_rad: float = math.nan
        """Yaw setpoint; NaN: keep the present one."""

    def heading_rad(self, state: FlightState, tau_psi_s: float) -> float:
        """Return the heading to fly now in the wind of `state`; `tau_psi_s`: its time constant and dead time."""
        if self.kind == HEADING:
            return self.direction_rad
        course_rad = self._circle_course(state, tau_psi_s) if self.kind == CIRCLE else self.direction_rad
        return course_rad - crab_rad(state, course_rad)

    def _circle_course(self, state: FlightState, tau_psi_s: float) -> float:
        """Return the course onto the circle and along it: clockwise, or anticlockwise for a negative radius."""
        north_m, east_m = state.north_m - self.centre_north_m, state.east_m - self.centre_east_m
        side = 1.0 if self.radius_m > 0.0 else -1.0
        off_rad = CAPTURE * (math.hypot(north_m, east_m) / abs(self.radius_m) - 1.0)
        off_rad = within(off_rad, -math.pi / 2.0, math.pi / 2.0)
        course_rad = math.atan2(east_m, north_m) + side * (math.pi / 2.0 + off_rad)
        if abs(off_rad) < ON_CIRCLE_RAD:
            course_rad += tau_psi_s * state.airspeed_mps / self.radius_m
        return course_rad


class Approach(NamedTuple):
    """The final approach to home: touch-down point, direction, and length and height at its start."""

    north_m: float
    east_m: float
    direction_rad: float
    length_m: float
    height_m: float
    speed_mps: float
    """Airspeed at which it touches down."""
    brakes_mps2: float
    """Deceleration on the ground."""
    height_delay_s: float
    """Delay of the height behind a setpoint on a ramp."""

    @property
    def begin_m(self) -> tuple[float, float]:
        """Its start, north and east."""
        cos, sin = math.cos(self.direction_rad), math.sin(self.direction_rad)
        return self.north_m - self.length_m * cos, self.east_m - self.length_m * sin

    def circle(self, radius_m: float) -> tuple[float, float]:
        """Return the centre, north and east, m, of the circle tangent to the approach at its start.

        A negative `radius_m` means an anticlockwise circle.
        """
        north_m, east_m = self.begin_m
        return north_m - radius_m * math.sin(self.direction_rad), east_m + radius_m * math.cos(self.direction_rad)

    def begins(self, motion: Motion) -> bool:
        """Return whether a vehicle on that circle is low enough and aligned with the approach."""
        course_rad = math.atan2(motion.velocity_east_mps, motion.velocity_north_mps)
        off_rad = math.remainder(course_rad - self.direction_rad, math.tau)
        low = abs(motion.height_m - self.height_m) < AT_HEIGHT_M
        return low and abs(off_rad) < LINED_UP_RAD and abs(self._drift_m(motion)) < LOOK_AHEAD_M

    def guide(self, motion: Motion) -> tuple[float, float]:
        """Return the course back to the approach line, rad, and the height of the glide slope, m."""
        share = (self._to_go_m(motion) - self._lead_m(motion)) / self.length_m
        course_rad = self.direction_rad - math.atan(self._drift_m(motion) / LOOK_AHEAD_M)
        return course_rad, max(share * self.height_m, -BELOW_GROUND_M)

    def _lead_m(self, motion: Motion) -> float:
        """Return by how much the glide slope ends before home, m: where braking ends, and for the height's delay.

        It brakes from its speed over ground on the approach's course, in the wind that carries it now.
        """
        wind_north_mps = motion.velocity_north_mps - motion.airspeed_mps * math.cos(motion.heading_rad)
        wind_east_mps = motion.velocity_east_mps - motion.airspeed_mps * math.sin(motion.heading_rad)
        carried_mps, across_mps = rotated(self.direction_rad, wind_north_mps, wind_east_mps)
        through_mps = math.sqrt(max(self.speed_mps**2 - across_mps**2, 0.0))
        ground_mps = max(through_mps + carried_mps, 0.0)
        return ground_mps**2 / (2.0 * self.brakes_mps2) + ground_mps * self.height_delay_s

    def _to_go_m(self, motion: Motion) -> float:
        north_m, east_m = self.north_m - motion.north_m, self.east_m - motion.east_m
        return north_m * math.cos(self.direction_rad) + east_m * math.sin(self.direction_rad)

    def _drift_m(self, motion: Motion) -> float:
        """Return the vehicle's distance to the right of the line."""
        north_m, east_m = motion.north_m - self.north_m, motion.east_m - self.east_m
        return east_m * math.cos(self.direction_rad) - north_m * math.sin(self.direction_rad)


def lift_off_mps(model: VehicleModel) -> float:
    """Return the lift-off airspeed of a fixed wing."""
    if model.airframe is not None:
        return AIRFRAMES_SHARE * model.airframe.airspeed_cruise_mps
    if model.firmware == "px4":
        return PX4S_SHARE * model.speed_max_mps
    return LIFT_OFF_SHARE * model.speed_min_mps


def full_throttle_model(model: VehicleModel) -> AutopilotModel | None:
    """Return the model of a take-off with full throttle, for a PX4 without an airframe; None for all others."""
    if model.firmware != "px4" or model.airframe is not None:
        return None
    climbs = model.autopilot()
    climbs.tau_v_s, climbs.accel_max_mps2, climbs.climb_max_mps = PX4S_TAU_S, PX4S_ACCEL_MPS2, PX4S_CLIMB_MPS
    climbs.speed_max_mps *= PX4S_CLIMB_SHARE
    return climbs
