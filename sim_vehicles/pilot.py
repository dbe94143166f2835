"""What an emulated ArduPlane does in each mode: it sets the vehicle's own element of the fleet's steering."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from sim_vehicles.config import VehicleConfig
from sim_vehicles.dynamics import State
from sim_vehicles.modes import Condition, Mode, Request, follow
from sim_vehicles.steering import CIRCLE, COURSE, HEADING, Steering

TAKEOFF_ALT_M = 50.0
"""TKOFF_ALT."""
TAKEOFF_DONE_M = 2.0
RTL_ALT_M = 100.0
LIFT_OFF_SHARE = 0.7
"""Share of the lowest flying speed at which the wheels leave the ground."""


@dataclass
class Pilot:
    """One vehicle's condition and mode, and what they make it do."""

    index: int
    config: VehicleConfig
    steering: Steering
    cruise_mps: float
    condition: Condition = Condition.BOOTING
    mode: Mode = Mode.INITIALISING
    home_height_m: float = 0.0
    guided_by_setpoints: bool = False
    """Whether 43000 or 43001 came since GUIDED was entered: other ways to change speed and height then do nothing."""

    @property
    def airborne(self) -> bool:
        """Whether it's off the ground."""
        return self.condition in (Condition.FLYING, Condition.BOOTING_IN_AIR)

    def request(self, request: Request) -> bool:
        """Follow the table of conditions; return whether the request was granted."""
        following = follow(self.condition, request)
        if following is None:
            return False
        self.condition = following
        self.steering.stopped[self.index] = not self._moves()
        return True

    def enter(self, mode: Mode, state: State) -> None:
        """Change the mode; what the last one was told is forgotten."""
        self.mode = mode
        self.guided_by_setpoints = False
        self.steering.lateral_mps2[self.index] = np.inf
        self.steering.stopped[self.index] = not self._moves()
        if self.condition is Condition.ARMED:
            self.hold_heading(state)
            self.steering.height_m[self.index] = self.home_height_m
        elif self.airborne:
            self._fly(mode, state)

    def hold_heading(self, state: State) -> None:
        """Fly straight on, level, at cruising speed."""
        steering, i = self.steering, self.index
        steering.kind[i] = HEADING
        steering.direction_rad[i] = state.heading_rad[i]
        steering.height_m[i] = state.height_m[i]
        steering.speed_mps[i] = self.cruise_mps

    def circle(self, north_m: float, east_m: float, height_m: float) -> None:
        """Circle a place clockwise."""
        steering, i = self.steering, self.index
        steering.kind[i] = CIRCLE
        steering.centre_m[:, i] = north_m, east_m
        steering.height_m[i] = height_m

    def steer(self, direction_rad: float, *, course: bool, lateral_mps2: float) -> None:
        """Fly a heading, or a course over ground, turning with a lateral acceleration."""
        steering, i = self.steering, self.index
        steering.kind[i] = COURSE if course else HEADING
        steering.direction_rad[i] = direction_rad
        steering.lateral_mps2[i] = lateral_mps2

    def progress(self, state: State) -> bool:
        """Let a take-off go on; return whether the vehicle has just left the ground."""
        if self.mode is not Mode.TAKEOFF:
            return False
        i, target_m = self.index, self.home_height_m + TAKEOFF_ALT_M
        if self.condition is Condition.ARMED:
            if state.airspeed_mps[i] < LIFT_OFF_SHARE * self.config.airframe.speed_min_mps:
                return False
            self.request(Request.LIFT_OFF)
            self.steering.height_m[i] = target_m
            return True
        if self.steering.kind[i] == HEADING and state.height_m[i] > target_m - TAKEOFF_DONE_M:
            self.circle(float(state.north_m[i]), float(state.east_m[i]), target_m)
        return False

    def _fly(self, mode: Mode, state: State) -> None:
        i = self.index
        here = float(state.north_m[i]), float(state.east_m[i])
        self.steering.speed_mps[i] = self.cruise_mps
        if mode is Mode.RTL or mode is Mode.AUTO:
            start = self.config.start
            self.circle(start.north_m, start.east_m, self.home_height_m + RTL_ALT_M)
        elif mode is Mode.MANUAL:
            self.hold_heading(state)
        else:
            self.circle(*here, float(state.height_m[i]))

    def _moves(self) -> bool:
        return self.airborne or (self.condition is Condition.ARMED and self.mode is Mode.TAKEOFF)
