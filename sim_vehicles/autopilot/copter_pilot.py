"""An emulated multirotor's behaviour in each of ArduCopter's modes. It writes the vehicle's `Steering`."""

from __future__ import annotations

import math
from typing import Final

from airlink import mavlink as m
from airlink.clock import NEVER, Instant, after
from flight_model.autopilot_model import within
from sim_vehicles.airframe.motion import Motion, Steering, Vector
from sim_vehicles.autopilot.modes_and_failsafe import (
    BY_THROTTLE,
    NOT_ARMABLE,
    Condition,
    CopterMode,
    FlightMode,
    Request,
)
from sim_vehicles.autopilot.parameters import ParameterServer
from sim_vehicles.autopilot.pilot import Pilot
from sim_vehicles.board_clock import LOOP_S
from sim_vehicles.config import VehicleConfig

CM: Final = 0.01
CM_PER_M: Final = 100.0
"""ArduCopter's parameters are in cm: a unit of theirs in m, and how many make a metre."""
TAKEOFF_DONE_M = 0.05
LOW_M = 10.0
"""Height below which a landing descends at LAND_SPEED (LAND_ALT_LOW)."""
HOME_M = 0.5
"""Distance from home within which a copter counts as above it."""
CLIMB_PER_S = 0.5
"""Vertical speed per metre of height error."""
PER_S, BRAKES_MPS2 = 0.7, 2.1
"""Horizontal speed per metre of distance, and twice the braking deceleration: 30 m are flown at up to 6.4 m/s, 60 m at
9.2."""
TOUCH_DOWN_M = 0.05
THROTTLE_DOWN_MPS = 2.5
"""Descent rate with the throttle down (PILOT_SPEED_DN)."""
AS_IT_IS = math.nan
HOMEWARD = frozenset({CopterMode.RTL, CopterMode.SMART_RTL})
SEEING = BY_THROTTLE | HOMEWARD | {CopterMode.LAND}
"""Modes in which `progress` depends on the position."""
Circle = tuple[float, float, float, float, float]
"""Centre north, east and above the origin (NaN: unlimited descent), radius, m, and speed, m/s, clockwise."""


class CopterPilot(Pilot):
    """One multirotor's condition and mode, and the resulting velocities."""

    def __init__(self, config: VehicleConfig, steering: Steering, parameters: ParameterServer) -> None:
        """Start booting."""
        self._home_over = False
        self._waits_s = 0.0
        """Remaining time above home before it lands."""
        self.target_m: Vector | None = None
        """Position to fly to and hold: north, east and above the origin."""
        self._circle: Circle | None = None
        self._nose_rad = AS_IT_IS
        """Yaw setpoint."""
        self._turn_rad, self._turn_rps = 0.0, 0.0
        """Remaining turn of the yaw, clockwise, and its rate."""
        self._seen_m: tuple[float, float] | None = None
        """Position that the nose points at, north and east."""
        self.paused = False
        self.commanded_cmps: dict[str, float] = {}
        """Commanded speeds that replace parameters, by the parameters' names."""
        super().__init__(config, steering, parameters, CopterMode.STABILIZE)

    @property
    def under_way(self) -> bool:
        """Whether it takes off, flies to a position or home, circles, lands, descends or turns, and is airborne."""
        goes = self.takeoff_m is not None or self.target_m is not None or self._circle is not None
        turns = self._turn_rad != 0.0 or self._seen_m is not None
        return (goes or turns or self.mode in SEEING) and self.airborne

    @property
    def landed_state(self) -> int:
        """MAV_LANDED_STATE, including take-off and landing."""
        if self.condition is not Condition.FLYING:
            return m.MAV_LANDED_STATE_ON_GROUND
        if self.takeoff_m is not None:
            return m.MAV_LANDED_STATE_TAKEOFF
        over = self.mode in HOMEWARD and self._home_over and self._waits_s <= 0.0
        lands = self.mode is CopterMode.LAND or over
        return m.MAV_LANDED_STATE_LANDING if lands else m.MAV_LANDED_STATE_IN_AIR

    def arm(self, motion: Motion) -> bool:  # noqa: ARG002 - it stays until take-off
        """Arm; return whether mode and condition allow it."""
        return self.mode not in NOT_ARMABLE and self.request(Request.ARM)

    def enter(self, mode: FlightMode, motion: Motion) -> None:  # noqa: ARG002 - it hovers where it is
        """Change the mode; the vehicle hovers until the mode makes it move."""
        self.mode = CopterMode(mode)
        self.takeoff_m, self._home_over = None, False
        self._waits_s = self._parameters["RTL_LOIT_TIME"] / 1000.0 if mode is CopterMode.RTL else 0.0
        self._seen_m, self.paused = None, False
        self.commanded_cmps.clear()
        self.stop()

    def fly_straight(self, motion: Motion) -> None:  # noqa: ARG002 - likewise
        """Hover, as a multirotor without setpoints does."""
        self.stop()

    def stop(self) -> None:
        """Drop all targets and hover."""
        self.silent_at, self.target_m, self._circle = NEVER, None, None
        self._point(AS_IT_IS)
        self.hover()

    def hover(self) -> None:
        """Hover, keeping the targets."""
        self._fly(0.0, 0.0, 0.0)

    def go_to(self, position_m: Vector, yaw_rad: float | None) -> None:
        """Fly to a position and hold it; `yaw_rad` None: keep the yaw."""
        self.silent_at, self.target_m, self._circle = NEVER, position_m, None
        self._point(AS_IT_IS if yaw_rad is None else yaw_rad)

    def go_round(self, circle: Circle) -> None:
        """Circle a position with the nose towards it."""
        self.silent_at, self.target_m, self._circle = NEVER, None, circle

    def obey(self, velocity_mps: Vector, yaw_rad: float | None, now: Instant) -> None:
        """Fly a velocity, north, east and down, until GUID_TIMEOUT; `yaw_rad` None: keep the yaw."""
        self.target_m = self._circle = None
        north, east, down = velocity_mps
        max_mps, speed = CM * self._parameters["WPNAV_SPEED"], math.hypot(north, east)
        share = min(1.0, max_mps / speed) if speed > 0.0 else 0.0
        self._point(AS_IT_IS if yaw_rad is None else yaw_rad)
        self._fly(share * north, share * east, down)
        self.silent_at = after(now, self._parameters["GUID_TIMEOUT"])

    def turn(self, nose_rad: float, by_rad: float, rate_rps: float) -> None:
        """Turn from the yaw `nose_rad` by an angle, clockwise, at a rate."""
        self._point(nose_rad)
        self._turn_rad, self._turn_rps = by_rad, rate_rps

    def turn_on(self, nose_rad: float, rate_rps: float) -> None:
        """Turn the yaw at a rate, clockwise, until GUID_TIMEOUT."""
        self.turn(nose_rad, rate_rps * self._parameters["GUID_TIMEOUT"], abs(rate_rps))

    def look_at(self, position_m: tuple[float, float] | None) -> None:
        """Keep the nose pointed at a position, north and east, m; None: stop doing so."""
        self._turn_rad, self._seen_m = 0.0, position_m

    def commanded_nose(self, shown_rad: float) -> float:
        """Return the yaw setpoint, or the present yaw `shown_rad` if there is none."""
        return shown_rad if math.isnan(self._nose_rad) else self._nose_rad

    def rise(self, height_m: float) -> bool:
        """Take off to a height; return whether that is possible."""
        if self.mode is not CopterMode.GUIDED or self.condition is not Condition.ARMED or height_m <= 0.0:
            return False
        self.takeoff_m = height_m
        return self.request(Request.LIFT_OFF)

    def progress(self, motion: Motion) -> bool:
        """Continue the current action; return whether the vehicle has just touched the ground."""
        self._follow_nose(motion)
        if self.takeoff_m is not None:
            self._climb(motion, self.takeoff_m)
        elif self.target_m is not None:
            self._fly_towards(motion, *self.target_m)
        elif self._circle is not None:
            self._fly_round(motion, self._circle)
        elif self.mode in HOMEWARD and (not self._home_over or self._waits_s > 0.0):
            self._go_home(motion)
        elif self.mode in SEEING:
            return self._sink(motion)
        return False

    def _follow_nose(self, motion: Motion) -> None:
        """Turn the yaw setpoint by a cycle, or to the position that the nose points at."""
        if self._seen_m is not None:
            self._nose_rad = math.atan2(self._seen_m[1] - motion.east_m, self._seen_m[0] - motion.north_m)
        elif self._turn_rad != 0.0:
            max_rad = self._turn_rps * LOOP_S
            step_rad = within(self._turn_rad, -max_rad, max_rad)
            self._nose_rad += step_rad
            self._turn_rad -= step_rad
        self._steering.yaw_rad = self._nose_rad

    def _sink(self, motion: Motion) -> bool:
        """Descend, slowly in a landing near the ground; return whether it has just touched the ground."""
        if self.mode in BY_THROTTLE:
            sink_mps = THROTTLE_DOWN_MPS
        else:
            sink_mps = CM * self._parameters["LAND_SPEED" if motion.height_m < LOW_M else "WPNAV_SPEED_DN"]
        self._fly(0.0, 0.0, sink_mps)
        if motion.height_m > TOUCH_DOWN_M:
            return False
        self.stop()
        return self.request(Request.TOUCH_DOWN)

    def _climb(self, motion: Motion, height_m: float) -> None:
        left_m = height_m - motion.height_m
        if left_m < TAKEOFF_DONE_M:
            self.takeoff_m = None
            self.stop()
        else:
            self._fly(0.0, 0.0, -min(CLIMB_PER_S * left_m + TAKEOFF_DONE_M, self._climb_max_mps(motion)))

    def _climb_max_mps(self, motion: Motion) -> float:  # noqa: ARG002 - the same at every height
        """Return the highest climb rate in a take-off."""
        return CM * self._parameters["WPNAV_SPEED_UP"]

    def _cruise_mps(self) -> float:
        """Return the highest speed towards a position."""
        return self._max_mps("WPNAV_SPEED")

    def _go_home(self, motion: Motion) -> None:
        """Climb to RTL_ALT, unless it is already higher or in SMART_RTL, fly straight home, and wait there."""
        start, height_m = self._config.start, CM * self._parameters["RTL_ALT"]
        near = math.hypot(start.north_m - motion.north_m, start.east_m - motion.east_m) < HOME_M
        self._home_over = self._home_over or near
        if self._home_over:
            self._waits_s -= LOOP_S
        low = height_m - motion.height_m > HOME_M and self.mode is CopterMode.RTL
        if low and not self._home_over:
            self._fly_towards(motion, motion.north_m, motion.east_m, height_m)
        else:
            self._fly_towards(motion, start.north_m, start.east_m, motion.height_m)

    def _fly_round(self, motion: Motion, circle: Circle) -> None:
        """Circle a position and approach the circle, with the nose towards its centre."""
        north_m, east_m, height_m, radius_m, speed_mps = circle
        from_north_m, from_east_m = motion.north_m - north_m, motion.east_m - east_m
        away_m = max(math.hypot(from_north_m, from_east_m), HOME_M)
        out, sinks_mps = within(PER_S * (radius_m - away_m), -abs(speed_mps), abs(speed_mps)), THROTTLE_DOWN_MPS
        if not math.isnan(height_m):
            sinks_mps = self._sink_to(height_m - motion.height_m)
        elif motion.height_m <= TOUCH_DOWN_M:
            self._circle = None
        north, east = from_north_m / away_m, from_east_m / away_m
        self._nose_rad = math.atan2(-east, -north)
        self._fly(out * north - speed_mps * east, out * east + speed_mps * north, sinks_mps)

    def _fly_towards(self, motion: Motion, north_m: float, east_m: float, height_m: float) -> None:
        """Fly straight to a position, braking before it."""
        to_north_m, to_east_m = north_m - motion.north_m, east_m - motion.east_m
        away_m = math.hypot(to_north_m, to_east_m)
        speed = min(PER_S * away_m, math.sqrt(BRAKES_MPS2 * away_m), self._cruise_mps())
        share = speed / max(away_m, HOME_M)
        self._fly(share * to_north_m, share * to_east_m, self._sink_to(height_m - motion.height_m))

    def _sink_to(self, below_m: float) -> float:
        """Return the descent rate, m/s, towards a height `below_m` above it."""
        return -within(CLIMB_PER_S * below_m, -self._max_mps("WPNAV_SPEED_DN"), self._max_mps("WPNAV_SPEED_UP"))

    def _max_mps(self, name: str) -> float:
        """Return the commanded speed that replaces a parameter, otherwise the parameter."""
        return CM * self.commanded_cmps.get(name, self._parameters[name])

    def _point(self, nose_rad: float) -> None:
        """Set the yaw, and stop turning."""
        self._nose_rad, self._turn_rad, self._seen_m = nose_rad, 0.0, None

    def _fly(self, north_mps: float, east_mps: float, down_mps: float) -> None:
        self._steering.velocity_mps = (0.0, 0.0, 0.0) if self.paused else (north_mps, east_mps, down_mps)
        self._steering.yaw_rad = self._nose_rad
