"""An emulated vehicle's behaviour in its modes, and a fixed wing's in ArduPlane's. It writes the vehicle's `Steering`.

Source: ArduPilot documentation, "AUTOLAND Mode". Unlike ArduPlane's, landings have no flare.
"""

from __future__ import annotations

import math
from abc import ABC, abstractmethod
from typing import Final, NamedTuple

from airlink import mavlink as m
from airlink.clock import NEVER, Instant
from sim_vehicles.airframe.motion import CIRCLE, COURSE, HEADING, Approach, Motion, Steering, lift_off_mps
from sim_vehicles.autopilot.modes_and_failsafe import STRAIGHT_ON, TRANSITIONS, Condition, FlightMode, Mode, Request
from sim_vehicles.autopilot.parameters import ParameterServer
from sim_vehicles.config import VehicleConfig

TAKEOFF_DONE_M: Final = 2.0
MIN_LEG_M: Final = 1e-3
"""Length below which a leg has no direction."""
TOUCH_DOWN_M: Final = 0.1
AUTOLAND: Final = Mode.AUTOLAND
BOOTING: Final = Condition.BOOTING
BOOTING_IN_AIR: Final = Condition.BOOTING_IN_AIR
FLYING: Final = Condition.FLYING
CRASHED: Final = Condition.CRASHED
TIGHTEST_SHARE: Final = 1.05
"""Smallest radius of a circle as a multiple of the tightest turn's."""


class Target(NamedTuple):
    """Position to fly to or circle, and the start of the leg there, north and east, m; None: it is circled."""

    north_m: float
    east_m: float
    begin_m: tuple[float, float] | None = None


class Pilot(ABC):
    """One vehicle's condition and mode, and the resulting flight. The ground is level, at the origin's height."""

    def __init__(
        self, config: VehicleConfig, steering: Steering, parameters: ParameterServer, mode: FlightMode
    ) -> None:
        """Start booting, in a mode."""
        self.condition = Condition.BOOTING_IN_AIR if config.start.in_air else Condition.BOOTING
        self.mode = mode
        self.takeoff_m: float | None = None
        """Height at which the take-off is complete, from the selection of TAKEOFF until then."""
        self.silent_at: Instant = NEVER
        """When the last setpoint expires without a new one; a plane's never does."""
        self._config = config
        self._steering = steering
        self._parameters = parameters
        self._tell_condition()

    @property
    def airborne(self) -> bool:
        """Whether it is in the air."""
        return self.condition is FLYING or self.condition is BOOTING_IN_AIR

    @property
    def booting(self) -> bool:
        """Whether its autopilot is still booting."""
        return self.condition is BOOTING or self.condition is BOOTING_IN_AIR

    @property
    def crashed(self) -> bool:
        """Whether it has crashed."""
        return self.condition is CRASHED

    @property
    @abstractmethod
    def under_way(self) -> bool:
        """Whether `progress` must be called in each cycle."""

    @property
    @abstractmethod
    def landed_state(self) -> int:
        """MAV_LANDED_STATE."""

    @abstractmethod
    def arm(self, motion: Motion) -> bool:
        """Arm, and begin the mode's action; return whether arming was allowed."""

    @abstractmethod
    def enter(self, mode: FlightMode, motion: Motion) -> None:
        """Change the mode; setpoints of the previous one are dropped."""

    @abstractmethod
    def fly_straight(self, motion: Motion) -> None:
        """Fly on without setpoints: straight, or hovering."""

    @abstractmethod
    def progress(self, motion: Motion) -> bool:
        """Continue the current action; return whether the vehicle has just left or touched the ground."""

    def restart(self, mode: FlightMode) -> None:
        """Start afresh in a mode after a restart of the autopilot."""
        self.mode = mode

    def to_go(self, motion: Motion) -> tuple[float, float, float]:
        """Return the target's bearing, rad, its distance, m, and the cross-track error, m."""
        return motion.heading_setpoint_rad, 0.0, 0.0

    def request(self, request: Request) -> bool:
        """Make the transition that the table of conditions allows; return whether there is one."""
        following = TRANSITIONS.get((self.condition, request))
        if following is None:
            return False
        self.condition = following
        self._tell_condition()
        return True

    def _tell_condition(self) -> None:
        steering, rises = self._steering, self.takeoff_m is not None
        rolls = self.condition is Condition.ARMED and rises
        steering.stopped = not (self.airborne or rolls)
        steering.airborne = self.airborne
        steering.takes_off = rolls or (steering.takes_off and self.airborne and rises)


class PlanePilot(Pilot):
    """Flies a fixed wing in ArduPlane's modes."""

    def __init__(self, config: VehicleConfig, steering: Steering, parameters: ParameterServer) -> None:
        """Start booting."""
        super().__init__(config, steering, parameters, Mode.INITIALISING)
        self.guided_by_setpoints = False
        """Whether a speed or height setpoint (commands 43000, 43001) has been received since GUIDED was entered. From
        then on, other commands that change speed or height are ignored."""
        self.target: Target | None = None
        """Position that it flies to or circles, or last did; None before the first."""
        self.final: Approach | None = None
        """The final approach of a mission's landing; None without one."""
        self._asked_m = 0.0
        """Radius requested for the present circle, m; 0: WP_LOITER_RAD."""
        self._guided_m = 0.0
        """Radius commanded since GUIDED was entered, m, 0 for WP_LOITER_RAD; and whether circles are anticlockwise."""
        self._guided_left = False
        self.landing_rad: float | None = None
        """Heading of the take-off, in which AUTOLAND lands; None without a take-off."""

    @property
    def under_way(self) -> bool:
        """Whether `progress` must be called in each cycle: it takes off, armed, or lands."""
        return self.climbing_out or self.landing

    @property
    def climbing_out(self) -> bool:
        """Whether it is in a take-off's ground run or climb."""
        return self.takeoff_m is not None and self.condition.armed

    @property
    def landed_state(self) -> int:
        """MAV_LANDED_STATE: in the air or on the ground."""
        return m.MAV_LANDED_STATE_IN_AIR if self.condition is FLYING else m.MAV_LANDED_STATE_ON_GROUND

    @property
    def radius_m(self) -> float:
        """Radius of the present or last circle, m."""
        return abs(self._steering.radius_m)

    @property
    def landing(self) -> bool:
        """Whether it is in AUTOLAND or in a mission's landing, and hasn't touched down."""
        return self.airborne and (self.mode is AUTOLAND or self.final is not None)

    def restart(self, mode: FlightMode) -> None:
        """Start afresh in a mode, and forget the heading of the take-off."""
        super().restart(mode)
        self.landing_rad = None

    def arm(self, motion: Motion) -> bool:
        """Arm, and begin the mode's action; return whether arming was allowed."""
        if not self.request(Request.ARM):
            return False
        if not self.airborne:
            self.enter(self.mode, motion)
        return True

    def enter(self, mode: FlightMode, motion: Motion) -> None:
        """Change the mode; setpoints of the previous one are dropped."""
        self.mode, self.final, self._guided_m = mode, None, 0.0
        self.guided_by_setpoints = False
        self.takeoff_m = self._parameters["TKOFF_ALT"] if mode is Mode.TAKEOFF and not self.airborne else None
        self._tell_condition()
        self.fly_straight(motion)
        if mode is Mode.RTL:
            start, height_m = self._config.start, self._parameters["RTL_ALTITUDE"]
            self.circle(start.north_m, start.east_m, motion.height_m if height_m < 0.0 else height_m)
        elif self.landing:
            radius_m = self._circle_radius_m()
            self.circle(*self._approach().circle(radius_m), self._parameters["AUTOLAND_WP_ALT"])
        elif mode not in STRAIGHT_ON and self.airborne:
            self.circle(motion.north_m, motion.east_m, motion.height_m)

    def fly_straight(self, motion: Motion) -> None:
        """Fly straight and level at cruising speed; `circle_again` will circle this position."""
        self.change_speed(self._parameters["AIRSPEED_CRUISE"], math.inf)
        self.circle(motion.north_m, motion.east_m, motion.height_m)
        self.steer(motion.heading_rad, course=False, lateral_mps2=math.inf)

    def to_go(self, motion: Motion) -> tuple[float, float, float]:
        """Return the target's bearing, rad, its distance, m, and the cross-track error, m: positive left or outside.

        Source: ArduPilot, AP_L1_Control (`crosstrack_error`).
        """
        target = self.target
        if target is None:
            return super().to_go(motion)
        north_m, east_m = target.north_m - motion.north_m, target.east_m - motion.east_m
        distance_m, bearing_rad = math.hypot(north_m, east_m), math.atan2(east_m, north_m)
        if target.begin_m is None:
            return bearing_rad, distance_m, distance_m - self.radius_m
        along_north_m, along_east_m = target.north_m - target.begin_m[0], target.east_m - target.begin_m[1]
        area_m2 = along_north_m * east_m - along_east_m * north_m
        return bearing_rad, distance_m, area_m2 / max(math.hypot(along_north_m, along_east_m), MIN_LEG_M)

    def circle(self, north_m: float, east_m: float, height_m: float, radius_m: float = 0.0) -> None:
        """Circle a position; `radius_m`: negative for an anticlockwise circle, 0 for WP_LOITER_RAD."""
        self._asked_m = radius_m
        self.target = Target(north_m, east_m)
        self._steering.centre_north_m, self._steering.centre_east_m = north_m, east_m
        self.change_height(height_m)
        self.circle_again()

    def ask_circle(self, radius_m: float, side: float) -> None:
        """Set the radius of GUIDED's circles, ignored if 0 or less, and their direction: clockwise for 0 and NaN.

        Source: ArduPlane, `handle_command_int_do_reposition`.
        """
        if math.isfinite(radius_m) and radius_m > 0.0:
            self._guided_m = radius_m
        self._guided_left = side != 0.0 and not math.isnan(side)

    def circle_guided(self, north_m: float, east_m: float, height_m: float) -> None:
        """Circle a position with the radius and direction commanded in GUIDED."""
        usual_m = self._parameters["WP_LOITER_RAD"]
        left = self._guided_left or usual_m < 0.0
        self.circle(north_m, east_m, height_m, (self._guided_m or abs(usual_m)) * (-1.0 if left else 1.0))

    def circle_again(self) -> None:
        """Circle the last position again, at the present height setpoint."""
        self._steering.radius_m = self._circle_radius_m()
        self._steering.lateral_mps2 = math.inf
        self._steering.kind = CIRCLE

    def steer(self, direction_rad: float, *, course: bool, lateral_mps2: float) -> None:
        """Fly a heading or a course over ground, turning at the given lateral acceleration."""
        steering = self._steering
        steering.kind = COURSE if course else HEADING
        steering.direction_rad = direction_rad
        steering.lateral_mps2 = lateral_mps2

    def guide_speed(self, speed_mps: float, accel_mps2: float) -> None:
        """Take an airspeed setpoint; a repeated one changes nothing, not even the acceleration."""
        if not self.guided_by_setpoints or speed_mps != self._steering.speed_mps:
            self.change_speed(speed_mps, accel_mps2)
        self.guided_by_setpoints = True

    def guide_height(self, height_m: float) -> None:
        """Take a height setpoint."""
        self.change_height(height_m)
        self.guided_by_setpoints = True

    def change_speed(self, speed_mps: float, accel_mps2: float) -> None:
        """Change to an airspeed at an acceleration."""
        self._steering.speed_mps = speed_mps
        self._steering.accel_mps2 = accel_mps2

    def change_height(self, height_m: float) -> None:
        """Climb or descend to a height above the origin."""
        self._steering.height_m = height_m

    def take_off(self, height_m: float, motion: Motion) -> None:
        """Climb straight ahead to a height, after a ground run if it is on the ground."""
        self.takeoff_m = height_m
        self._tell_condition()
        self.fly_straight(motion)
        if self.airborne:
            self.change_height(height_m)

    def progress(self, motion: Motion) -> bool:
        """Continue a take-off or a landing; return whether the vehicle has just left or touched the ground."""
        return self._land(motion) if self.landing else self._climb_out(motion)

    def _climb_out(self, motion: Motion) -> bool:
        target_m = self.takeoff_m
        if target_m is None:
            return False
        if self.condition is Condition.ARMED:
            if motion.airspeed_mps < lift_off_mps(self._config.model):
                return False
            self.change_height(target_m)
            self.landing_rad = motion.heading_rad
            return self.request(Request.LIFT_OFF)
        if motion.height_m > target_m - TAKEOFF_DONE_M:
            self.takeoff_m = None
            self._tell_condition()
            self.circle(motion.north_m, motion.east_m, target_m)
        return False

    def _land(self, motion: Motion) -> bool:
        approach, circles = self._approach(), self._steering.kind == CIRCLE
        if circles and not approach.begins(motion):
            return False
        course_rad, height_m = approach.guide(motion)
        self.target = Target(approach.north_m, approach.east_m, approach.begin_m)
        self.change_speed(self._parameters["AIRSPEED_MIN"], math.inf)
        self.steer(course_rad, course=True, lateral_mps2=math.inf)
        self.change_height(height_m)
        return motion.height_m < TOUCH_DOWN_M and self.request(Request.TOUCH_DOWN)

    def land_at(self, north_m: float, east_m: float, motion: Motion) -> None:
        """If airborne, land straight ahead from here at a position."""
        if not self.airborne:
            return
        to_north_m, to_east_m = north_m - motion.north_m, east_m - motion.east_m
        length_m = max(math.hypot(to_north_m, to_east_m), 1.0)
        direction_rad = math.atan2(to_east_m, to_north_m)
        speed_mps = self._touch_down_mps(motion.airspeed_mps)
        self.final = self._over(north_m, east_m, direction_rad, length_m, motion.height_m, speed_mps)
        self._steering.kind = COURSE

    def _approach(self) -> Approach:
        """Return the final approach: a mission's, or AUTOLAND's, which touches down so that braking ends at home."""
        if self.final is not None:
            return self.final
        start, length_m = self._config.start, self._parameters["AUTOLAND_WP_DIST"]
        height_m, direction_rad = self._parameters["AUTOLAND_WP_ALT"], self.landing_rad or 0.0
        speed_mps = self._touch_down_mps()
        return self._over(start.north_m, start.east_m, direction_rad, length_m, height_m, speed_mps)

    def _over(
        self, north_m: float, east_m: float, direction_rad: float, length_m: float, height_m: float, speed_mps: float
    ) -> Approach:
        """Return an approach to a position of this aircraft."""
        model = self._config.model
        brakes_mps2, height_delay_s = model.accel_max_mps2, model.tau_ha_s + model.tau_hb_s
        return Approach(north_m, east_m, direction_rad, length_m, height_m, speed_mps, brakes_mps2, height_delay_s)

    def _touch_down_mps(self, airspeed_mps: float = 0.0) -> float:
        """Return the airspeed at which it touches down, from its present one.

        It reduces its speed to AIRSPEED_MIN, but a throttle's integrator takes longer than an approach.
        """
        speed_mps = self._parameters["AIRSPEED_MIN"]
        return speed_mps + (1.0 - self._config.model.prompt_share) * max(airspeed_mps - speed_mps, 0.0)

    def _circle_radius_m(self) -> float:
        tightest_m = self._steering.speed_mps / self._config.model.turn_rate_max_rps
        asked_m = self._asked_m or self._parameters["WP_LOITER_RAD"]
        return math.copysign(max(abs(asked_m), TIGHTEST_SHARE * tightest_m), asked_m)
