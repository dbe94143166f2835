"""What an emulated ArduCopter does in each mode. It writes the vehicle's elements of the fleet's `Steering`.

Unlike a real one it has no transmitter and no battery, and its RTL flies at one speed.
"""

from __future__ import annotations

import math

from airlink.clock import Instant, after
from sim_vehicles.airframe.motion import Motion
from sim_vehicles.airframe.steering import Steering
from sim_vehicles.autopilot.clock import NEVER
from sim_vehicles.autopilot.modes import BY_THROTTLE, NOT_ARMABLE, Condition, CopterMode, FlightMode, Request
from sim_vehicles.autopilot.parameters import ParameterServer
from sim_vehicles.autopilot.pilot import Pilot
from sim_vehicles.config import VehicleConfig

CM = 0.01
TAKEOFF_DONE_M = 0.05
LOW_M = 10.0
"""Height below which a landing goes on at LAND_SPEED (LAND_ALT_LOW)."""
HOME_M = 0.5
"""A copter this near its home is over it."""
PER_S, BRAKES_MPS2 = 0.5, 1.5
"""How fast what is left of a way is flown off, and the deceleration of a long one (twice the mean)."""
TOUCH_DOWN_M = 0.05
AS_IT_IS = math.nan
SEEING = BY_THROTTLE | {CopterMode.RTL, CopterMode.LAND}
"""Modes in which it has to look where it is."""


class CopterPilot(Pilot):
    """One multirotor's condition and mode, and the resulting velocities."""

    def __init__(self, config: VehicleConfig, steering: Steering, parameters: ParameterServer) -> None:
        """Start in the condition of booting."""
        self._home_over = False
        super().__init__(config, steering, parameters)
        self.mode = CopterMode.STABILIZE

    @property
    def taking_off(self) -> bool:
        """Whether it has to look where it is: it takes off, comes home, lands or sinks."""
        return (self.takeoff_m is not None or self.mode in SEEING) and self.airborne

    @property
    def landing(self) -> bool:
        """Return False: `taking_off` tells of landings too."""
        return False

    def arm(self, motion: Motion) -> bool:  # noqa: ARG002 - it stands until it takes off
        """Arm; return whether the mode and the condition allow it."""
        return self.mode not in NOT_ARMABLE and self.request(Request.ARM)

    def enter(self, mode: FlightMode, motion: Motion) -> None:  # noqa: ARG002 - it stands where it is
        """Change the mode; it stands until that has it do something."""
        self.mode = CopterMode(mode)
        self.takeoff_m, self._home_over = None, False
        self.stop()

    def fly_straight(self, motion: Motion) -> None:  # noqa: ARG002 - likewise
        """Stand: that is what one without setpoints does."""
        self.stop()

    def stop(self) -> None:
        """Stand where it is."""
        self.silent_at = NEVER
        self._fly(0.0, 0.0, 0.0)

    def obey(self, velocity_mps: tuple[float, float, float], yaw_rad: float | None, now: Instant) -> None:
        """Fly a velocity, north, east and down, until GUID_TIMEOUT; `yaw_rad` None: the nose stays where it is."""
        north, east, down = velocity_mps
        most_mps, speed = CM * self._parameters["WPNAV_SPEED"], math.hypot(north, east)
        share = min(1.0, most_mps / speed) if speed > 0.0 else 0.0
        self._fly(share * north, share * east, down, AS_IT_IS if yaw_rad is None else yaw_rad)
        self.silent_at = after(now, self._parameters["GUID_TIMEOUT"])

    def rise(self, height_m: float) -> bool:
        """Take off to a height; return whether that is possible."""
        if self.mode is not CopterMode.GUIDED or self.condition is not Condition.ARMED or height_m <= 0.0:
            return False
        self.takeoff_m = height_m
        return self.request(Request.LIFT_OFF)

    def progress(self, motion: Motion) -> bool:
        """Continue a take-off, a way home or a landing; return whether it has just touched the ground."""
        if self.takeoff_m is not None:
            self._climb(motion, self.takeoff_m)
            return False
        sink_mps = CM * self._parameters["WPNAV_SPEED_DN"]
        if self.mode is CopterMode.RTL and not self._home_over:
            self._go_home(motion)
            return False
        if self.mode in (CopterMode.RTL, CopterMode.LAND) and motion.height_m < LOW_M:
            sink_mps = CM * self._parameters["LAND_SPEED"]
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
            self._fly(0.0, 0.0, -min(PER_S * left_m + TAKEOFF_DONE_M, CM * self._parameters["WPNAV_SPEED_UP"]))

    def _go_home(self, motion: Motion) -> None:
        """Climb to RTL_ALT, unless it is higher already, and fly straight home."""
        start = self._config.start
        north_m, east_m = start.north_m - motion.north_m, start.east_m - motion.east_m
        away_m, below_m = math.hypot(north_m, east_m), CM * self._parameters["RTL_ALT"] - motion.height_m
        self._home_over = away_m < HOME_M
        if below_m > HOME_M and not self._home_over:
            self._fly(0.0, 0.0, -min(PER_S * below_m, CM * self._parameters["WPNAV_SPEED_UP"]))
        else:
            speed = min(PER_S * away_m, math.sqrt(BRAKES_MPS2 * away_m), CM * self._parameters["WPNAV_SPEED"])
            self._fly(speed * north_m / max(away_m, HOME_M), speed * east_m / max(away_m, HOME_M), 0.0)

    def _fly(self, north_mps: float, east_mps: float, down_mps: float, yaw_rad: float = AS_IT_IS) -> None:
        self._steering.velocity_mps = (north_mps, east_mps, down_mps)
        self._steering.yaw_rad = yaw_rad
