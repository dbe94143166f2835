"""Motion of multirotors: they follow ground velocities with a time constant and limited acceleration and jerk.

Part of a velocity change may be left to an integrator that compensates drag. Fitted to steps of ArduCopter's and PX4's
simulators (docs/real-autopilots.md). A multirotor holds its ground velocity, so wind doesn't carry it away: a change of
wind accelerates it by its drag, and it corrects that. Through the air it is no faster than its tilt allows.
"""

from __future__ import annotations

import math
from collections import deque
from typing import Final

from flight_model.autopilot_model import within, wrap
from flight_model.slot import slot_axis
from sim_vehicles.airframe.body import Body, dead_cycles
from sim_vehicles.airframe.motion import Motion
from sim_vehicles.board_clock import LOOP_S
from sim_vehicles.config import VehicleConfig

DEAD_CYCLES: Final = {"ardupilot": 5, "px4": 1}
"""Cycles of the main loop, 0.02 s, from a velocity setpoint's arrival until it acts, by firmware."""
JERKS_MPS3: Final = {"ardupilot": 5.0, "px4": 15.0}
"""PSC_JERK_XY of ArduCopter; PX4's as observed."""
DRAG_S: Final = {"ardupilot": 1.5, "px4": 1.0}
"""Time constant with which air takes it along that nothing makes up for: of ArduPilot's quadrotor in 6 to 8 m/s (its
drag is quadratic), of PX4's its mass, 1 kg, by SIH_KDV, 1 N s/m."""
AIRSPEEDS_MPS: Final = {"ardupilot": 10.7, "px4": 9.7}
"""The greatest that quadrotors of real autopilots reached, commanded more, in 6 and 4 m/s of wind: ArduPilot's in step
with the virtual clock (in its own simulator wind is weaker below 60 m), PX4's in its own. A model that is faster over
ground is so through the air."""
CLIMB_DEAD_CYCLES: Final = 7
CLIMB_ACCEL_MPS2: Final = 1.2
"""WPNAV_ACCEL_Z, nominally 1.0, as observed."""
CLIMB_TAU_S: Final = 0.15
"""Time constant of the vertical speed behind a reference with that acceleration."""
YAW_DEAD_CYCLES: Final = 10
YAW_TAU_S: Final = 0.12
"""Each of two time constants of the yaw behind a reference that turns at `YAW_RATE_RPS`."""
YAW_RATE_RPS: Final = 1.1
"""ATC_SLEW_YAW, nominally 60 degrees/s, as observed."""
MIN_TAU_S: Final = 0.05
Velocity = tuple[float, float, float]
"""Ground velocity: north, east, down, m/s."""
AT_REST: Velocity = (0.0, 0.0, 0.0)


class HoveringBody(Body):
    """A multirotor; its state's airspeed is its ground speed, its heading the axis of slots behind it."""

    def __init__(self, config: VehicleConfig, wind_mps: Velocity, seed: int) -> None:
        """Start as configured."""
        super().__init__(config, wind_mps, seed)
        model, start = config.model, config.start
        self._tau_s: float = max(model.tau_v_s - DEAD_CYCLES[model.firmware] * LOOP_S, MIN_TAU_S)
        both_s2, sum_s = model.tau_ha_s * model.tau_hb_s, model.tau_ha_s + model.tau_hb_s
        reaction_s = CLIMB_DEAD_CYCLES * LOOP_S + CLIMB_TAU_S
        self._climb_tau_s: float = max(both_s2 / sum_s - reaction_s, MIN_TAU_S)
        north_mps, east_mps = (start.airspeed_mps * f(start.heading_rad) for f in (math.cos, math.sin))
        self.velocity_mps: Velocity = (north_mps, east_mps, 0.0)
        self.yaw_rad: float = start.heading_rad
        self.yaw_rate_radps: float = 0.0
        self._jerk_mps3: float = JERKS_MPS3[model.firmware]
        self._integrated_mps: tuple[float, float] = (north_mps, east_mps)
        self._accel: tuple[float, float] = (0.0, 0.0)
        self._air_mps: Velocity = wind_mps
        """The air's velocity whose drag it makes up for."""
        self._drag_s: float = DRAG_S[model.firmware]
        self._airspeed_mps: float = max(model.speed_max_mps, AIRSPEEDS_MPS[model.firmware])
        dead = dead_cycles(model.dead_time_s)
        self._commanded: deque[Velocity] = deque([self.velocity_mps] * (DEAD_CYCLES[model.firmware] + dead))
        self._sinks: deque[float] = deque([0.0] * (CLIMB_DEAD_CYCLES + dead))
        self._sink_aimed_mps: float = 0.0
        self._noses: deque[float] = deque([math.nan] * (YAW_DEAD_CYCLES + dead))
        self._nose_aimed_rad: float = start.heading_rad
        self._nose_between_rad: float = start.heading_rad

    def ground_velocity(self) -> Velocity:
        """Return ground velocity north, east and down, m/s."""
        if not self.steering.airborne:
            return self.velocity_mps
        north_mps, east_mps, down_mps = self.velocity_mps
        return north_mps + self.unknown_mps[0], east_mps + self.unknown_mps[1], down_mps + self.unknown_mps[2]

    def ground(self) -> None:
        """Put the vehicle on the ground, at rest."""
        super().ground()
        self.yaw_rate_radps = 0.0
        self.velocity_mps, self._accel, self._sink_aimed_mps = AT_REST, (0.0, 0.0), 0.0
        self._integrated_mps = 0.0, 0.0
        self._air_mps = self.air_north_mps, self.air_east_mps, self.air_down_mps

    def shown(self) -> Motion:
        """Return its motion as sensed: ground speed in place of airspeed, yaw in place of the slots' axis."""
        shown, (north_mps, east_mps, down_mps) = self.motion.copy(), self.ground_velocity()
        shown.airspeed_mps = math.sqrt(north_mps * north_mps + east_mps * east_mps + down_mps * down_mps)
        shown.heading_rad, shown.yaw_rate_radps = self.yaw_rad, self.yaw_rate_radps
        return shown

    def fly(self) -> None:
        """Advance by a cycle of the main loop; a vehicle on the ground stays there."""
        self._motion = None
        self._commanded.append(self.steering.velocity_mps)
        self._sinks.append(self.steering.velocity_mps[2])
        self._noses.append(self.steering.yaw_rad)
        commanded, sink_mps, nose_rad = self._commanded.popleft(), self._sinks.popleft(), self._noses.popleft()
        if not self.steering.airborne:
            self.ground()
            return
        before = self.velocity_mps
        self._accelerate(commanded, sink_mps)
        self._turn_nose(nose_rad)
        north, east, down = self.velocity_mps
        state = self.state
        unknown = self.unknown_mps
        state.north_m += LOOP_S * ((north + before[0]) / 2.0 + unknown[0])
        state.east_m += LOOP_S * ((east + before[1]) / 2.0 + unknown[1])
        state.height_m -= LOOP_S * ((down + before[2]) / 2.0 + unknown[2])
        if state.height_m < 0.0:
            state.height_m, self.velocity_mps, self._sink_aimed_mps = 0.0, (north, east, 0.0), 0.0
        north, east, down = self.ground_velocity()
        state.climb_mps, state.airspeed_mps = -down, math.hypot(north, east)
        turned_rad = wrap(slot_axis(self.yaw_rad, north, east) - state.heading_rad)
        state.heading_rad += turned_rad
        self.turn_rate_radps = turned_rad / LOOP_S
        self.speed_commanded_mps, self.heading_commanded_rad = (
            math.hypot(commanded[0], commanded[1]),
            math.atan2(commanded[1], commanded[0]),
        )
        self.height_commanded_m = state.height_m

    def _accelerate(self, commanded: Velocity, sink_mps: float) -> None:
        """Change the velocity in a cycle, towards the setpoint and by drag that isn't made up for."""
        before, air = self.velocity_mps, (self.air_north_mps, self.air_east_mps, self.air_down_mps)
        north_mps, east_mps = self._through_air(*self._velocity_reference(commanded))
        wanted = _limited(
            (north_mps - before[0]) / self._tau_s, (east_mps - before[1]) / self._tau_s, self.model.accel_max_mps2
        )
        change = _limited(wanted[0] - self._accel[0], wanted[1] - self._accel[1], self._jerk_mps3 * LOOP_S)
        self._accel = self._accel[0] + change[0], self._accel[1] + change[1]
        sink = within((sink_mps - self._sink_aimed_mps) / self._climb_tau_s, -CLIMB_ACCEL_MPS2, CLIMB_ACCEL_MPS2)
        self._sink_aimed_mps += sink * LOOP_S
        known, drag_s, share = self._air_mps, self._drag_s, self._filled
        pushes = air[0] - known[0], air[1] - known[1], air[2] - known[2]
        self._air_mps = known[0] + share * pushes[0], known[1] + share * pushes[1], known[2] + share * pushes[2]
        accels = (*self._accel, (self._sink_aimed_mps - before[2]) / CLIMB_TAU_S)
        north, east, down = (
            v + LOOP_S * (a + push / drag_s) for v, a, push in zip(before, accels, pushes, strict=True)
        )
        self.velocity_mps = north, east, down

    def _through_air(self, north_mps: float, east_mps: float) -> tuple[float, float]:
        """Return the velocity over ground nearest to one that its tilt allows through the air."""
        wind_north_mps, wind_east_mps = self.air_north_mps, self.air_east_mps
        north, east = north_mps - wind_north_mps, east_mps - wind_east_mps
        if math.hypot(north, east) <= self._airspeed_mps:
            return north_mps, east_mps
        north, east = _limited(north, east, self._airspeed_mps)
        return wind_north_mps + north, wind_east_mps + east

    def _velocity_reference(self, commanded: Velocity) -> tuple[float, float]:
        """Return the velocity approached at present: prompt share of the command plus integrator."""
        prompt, share, done = self._prompt, self._filled, self._integrated_mps
        self._integrated_mps = done[0] + share * (commanded[0] - done[0]), done[1] + share * (commanded[1] - done[1])
        return prompt * commanded[0] + (1.0 - prompt) * done[0], prompt * commanded[1] + (1.0 - prompt) * done[1]

    def _turn_nose(self, commanded_rad: float) -> None:
        """Turn the yaw behind a reference that approaches the setpoint at a constant rate."""
        if not math.isnan(commanded_rad):
            max_rad = YAW_RATE_RPS * LOOP_S
            self._nose_aimed_rad += within(wrap(commanded_rad - self._nose_aimed_rad), -max_rad, max_rad)
        share = LOOP_S / YAW_TAU_S
        self._nose_between_rad += share * (self._nose_aimed_rad - self._nose_between_rad)
        turned_rad = share * (self._nose_between_rad - self.yaw_rad)
        self.yaw_rad += turned_rad
        self.yaw_rate_radps = turned_rad / LOOP_S


def _limited(north: float, east: float, maximum: float) -> tuple[float, float]:
    """Return a vector, shortened to length `maximum` if it is longer."""
    share = min(1.0, maximum / max(math.hypot(north, east), 1e-9))
    return share * north, share * east
