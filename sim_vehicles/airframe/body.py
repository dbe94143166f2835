"""Motion of one vehicle, by equation (7) or under total-energy control."""

from __future__ import annotations

import math
from collections import deque
from dataclasses import replace
from typing import Final

import numpy as np

from airlink.random_streams import random_stream
from flight_model import energy
from flight_model.autopilot_model import AutopilotModel, advance, within
from flight_model.energy import GRAVITY_MPS2, PHYSICAL, AirframeParameters
from flight_model.flight_state import FlightState
from formation_scenario.vehicles import EnergyAirframe
from sim_vehicles.airframe.in_air import InAir
from sim_vehicles.airframe.motion import MIN_SPEED_MPS, Motion, Steering, full_throttle_model
from sim_vehicles.board_clock import LOOP_S
from sim_vehicles.config import Pitot, VehicleConfig

MIN_SHARE = 0.2
"""Lower bound of a drawn parameter, as a share of its mean."""
BLOCK = 256
STANDING_MPS: Final = 1e-3
"""Airspeed below which a vehicle with throttle 0 is at rest."""
THROTTLE_WAITS_S: Final = 0.3
"""Time from arming in TAKEOFF until the propeller pulls."""


class EnergyFlight:
    """Flight of one aircraft under total-energy control; its parameters are drawn about its type's."""

    def __init__(
        self, keys: EnergyAirframe, parameters: AirframeParameters, state: FlightState, random: np.random.Generator
    ) -> None:
        """Trim the aircraft; `random` gives its airspeed sensor's errors."""
        self._keys, self._parameters, self._random = keys, parameters, random
        self._aircraft = energy.Aircraft(state.height_m, state.climb_mps, state.airspeed_mps, state.heading_rad)
        energy.trim(self._aircraft, parameters)
        self._cycle = 0
        self._ran = 0
        """Number of cycles of the present take-off."""
        self._noise_mps: list[float] = []
        self._period = max(1, round(1.0 / (keys.airspeed_rate_hz * LOOP_S)))
        level = energy.Commanded(state.airspeed_mps, math.inf, state.heading_rad, math.inf, state.height_m)
        wait = 1 + round(parameters.dead_time_s / LOOP_S)
        self._commanded: deque[energy.Commanded] = deque([level] * wait, maxlen=wait)
        """Commands within the dead time, oldest first."""
        self.shown_mps = state.airspeed_mps
        """Airspeed in telemetry."""

    def fly(
        self,
        state: FlightState,
        speed_mps: float,
        heading_rad: float,
        height_m: float,
        accel_max_mps2: float,
        turn_rate_max_rps: float,
    ) -> None:
        """Advance `state` by a cycle of the main loop."""
        aircraft = self._aircraft
        self._load(state)
        if self._ran:
            energy.level_out(aircraft)
            self._ran = 0
        bank_rad = math.atan(turn_rate_max_rps * max(state.airspeed_mps, energy.MIN_MPS) / GRAVITY_MPS2)
        self._commanded.append(energy.Commanded(speed_mps, accel_max_mps2, heading_rad, bank_rad, height_m))
        commanded = self._commanded[0]
        if self._cycle % energy.CYCLES == 0:
            energy.control(aircraft, commanded, self._parameters)
        energy.cycle(aircraft, commanded, self._parameters, self._noise())
        self._store(state)

    def take_off(
        self, state: FlightState, speed_mps: float, heading_rad: float, height_m: float, *, airborne: bool
    ) -> None:
        """Roll, or once airborne climb, for a cycle with full throttle; only the heading is commanded."""
        aircraft, parameters, begins = self._aircraft, self._parameters, self._ran == 0
        self._load(state)
        self._ran += 1
        commanded = energy.Commanded(speed_mps, math.inf, heading_rad, math.inf, height_m)
        self._commanded.append(commanded)
        full, noise_mps = energy.full_throttle(parameters), self._noise()
        if airborne:
            energy.climb_out(aircraft, full, parameters)
            energy.cycle(aircraft, commanded, parameters, noise_mps)
        else:
            if begins:
                aircraft.sensed = state.airspeed_mps
            opened_s = self._ran * LOOP_S - THROTTLE_WAITS_S
            energy.run(aircraft, full * within(opened_s * parameters.throttle_slew_per_s, 0.0, 1.0), parameters)
        self._store(state)

    def _store(self, state: FlightState) -> None:
        """Store the aircraft's motion in a cycle in `state`."""
        aircraft = self._aircraft
        north_mps, east_mps = _along(state)
        state.height_m, state.climb_mps = aircraft.height_m, aircraft.climb_mps
        state.airspeed_mps, state.heading_rad = aircraft.speed_mps, aircraft.heading_rad
        then_north_mps, then_east_mps = _along(state)
        state.north_m += LOOP_S * ((north_mps + then_north_mps) / 2.0 + state.wind_north_mps)
        state.east_m += LOOP_S * ((east_mps + then_east_mps) / 2.0 + state.wind_east_mps)
        self._show()

    def roll(self, state: FlightState, speed_mps: float, heading_rad: float, height_m: float) -> None:
        """Update for a cycle on the ground, where the vehicle rolls by equation (7)."""
        self._load(state)
        self._ran = 0
        energy.trim(self._aircraft, self._parameters)
        self._noise()  # keeps the noise sequence in step with cycles
        self._commanded.append(energy.Commanded(speed_mps, math.inf, heading_rad, math.inf, height_m))
        self._show()

    def _load(self, state: FlightState) -> None:
        aircraft = self._aircraft
        aircraft.height_m, aircraft.climb_mps = state.height_m, state.climb_mps
        aircraft.speed_mps, aircraft.heading_rad = state.airspeed_mps, state.heading_rad

    def _noise(self) -> float:
        """Return the next white error of the sensor, m/s."""
        if not self._noise_mps:
            self._noise_mps = self._random.standard_normal(BLOCK)[::-1].tolist()
        return self._keys.airspeed_noise_mps * self._noise_mps.pop()

    def _show(self) -> None:
        """Sample the sensor's airspeed for telemetry when due."""
        self._cycle += 1
        if self._cycle % self._period == 0:
            step_mps, sensed_mps = self._keys.airspeed_step_mps, self._aircraft.sensed
            self.shown_mps = round(sensed_mps / step_mps) * step_mps if step_mps > 0.0 else sensed_mps


def energy_flight(config: VehicleConfig, state: FlightState, seed: int) -> EnergyFlight | None:
    """Return the total-energy flight of a vehicle with an airframe, None for one that flies by equation (7)."""
    keys = config.model.airframe
    if keys is None:
        return None
    random = random_stream(seed, "airframe", *config.identity)
    usual, own = keys.parameters(), dict[str, float]()
    for name in PHYSICAL:
        own[name] = getattr(usual, name) * max(1.0 + keys.spread * float(random.standard_normal()), MIN_SHARE)
    return EnergyFlight(keys, replace(usual, **own), state, random)


def _along(state: FlightState) -> tuple[float, float]:
    """Return the components of airspeed north and east."""
    return state.airspeed_mps * math.cos(state.heading_rad), state.airspeed_mps * math.sin(state.heading_rad)


Setpoints = tuple[float, float, float, float, float]
"""What it aims at: airspeed, m/s, heading, rad, height, m, acceleration, m/s², and lateral acceleration, m/s²."""


def dead_cycles(dead_time_s: float) -> int:
    """Return the cycles of the main loop that a dead time takes."""
    return round(dead_time_s / LOOP_S)


class Body(InAir):
    """A vehicle that flies by equation (7), or under total-energy control if its model has an airframe."""

    def __init__(self, config: VehicleConfig, wind_mps: tuple[float, float, float], seed: int) -> None:
        """Start as configured; `wind_mps` is north, east and down, `seed` the fleet's."""
        start = config.start
        state = FlightState(
            start.north_m, start.east_m, start.height_m, 0.0, start.airspeed_mps, start.heading_rad, 0.0, 0.0
        )
        super().__init__(config.model.autopilot(), state, wind_mps)
        self._dead_s = config.model.dead_time_s
        self.steering = Steering()
        self.drift_down_mps: float = 0.0
        """Vertical velocity of the air at the vehicle, as `state.wind_*` horizontally; 0 on the ground."""
        self.unknown_mps: tuple[float, float, float] = (0.0, 0.0, 0.0)
        """Velocity north, east and down at which it flies without knowing, by its estimate's errors."""
        self.speed_commanded_mps: float = 0.0
        self.heading_commanded_rad: float = start.heading_rad
        self.height_commanded_m: float = start.height_m
        self.turn_rate_radps: float = 0.0
        self._energy: EnergyFlight | None = energy_flight(config, self.state, seed)
        self._full_throttle: AutopilotModel | None = full_throttle_model(config.model)
        self.pitot: Pitot | None = config.pitot
        self._prompt: float = config.model.prompt_share
        self._filled: float = LOOP_S / config.model.rest_s
        self._rest_mps: float = start.airspeed_mps
        """State of its airspeed integrator, if its model has one."""
        self._motion: Motion | None = None
        first = start.airspeed_mps, start.heading_rad, start.height_m, math.inf, math.inf
        held = dead_cycles(self._dead_s)
        self._waiting: deque[Setpoints] | None = deque([first] * held) if held else None
        """What it was commanded in its dead time, oldest first."""

    @property
    def motion(self) -> Motion:
        """Its motion; computed on demand, since in most cycles a vehicle sends nothing."""
        motion = self._motion
        if motion is None:
            motion = self._motion = self._build_motion()
        return motion

    @property
    def shown_mps(self) -> float | None:
        """Airspeed as last measured by its sensor; None if that is exact."""
        return None if self._energy is None else self._energy.shown_mps

    def shown(self) -> Motion:
        """Return its motion with the airspeed that its sensor shows."""
        shown_mps = self.shown_mps
        if shown_mps is None:
            return self.motion
        shown = self.motion.copy()
        shown.airspeed_mps = shown_mps
        return shown

    @property
    def airborne(self) -> bool:
        """Whether its pilot has it off the ground."""
        return self.steering.airborne

    def ground_velocity(self) -> tuple[float, float, float]:
        """Return ground velocity north, east and down, m/s."""
        state = self.state
        return (
            state.wind_north_mps + state.airspeed_mps * math.cos(state.heading_rad),
            state.wind_east_mps + state.airspeed_mps * math.sin(state.heading_rad),
            self.drift_down_mps - state.climb_mps,
        )

    def ground(self) -> None:
        """Put the vehicle on the ground, at rest."""
        self.state.height_m = self.state.climb_mps = self.state.airspeed_mps = self._rest_mps = 0.0
        self._motion = None

    def fly(self) -> None:
        """Advance by a cycle of the main loop; a vehicle at rest on the ground stays there."""
        state, steering = self.state, self.steering
        self._drift()
        if steering.stopped and state.airspeed_mps < STANDING_MPS:
            return
        self._motion = None
        self._take_setpoints()
        before_rad = state.heading_rad
        speed_mps, heading_rad, height_m, accel_mps2, lateral_mps2 = self._acting()
        turn_rate_max_rps = lateral_mps2 / max(state.airspeed_mps, MIN_SPEED_MPS)
        if self._energy is not None and steering.takes_off:
            self._energy.take_off(state, speed_mps, heading_rad, height_m, airborne=steering.airborne)
        elif self._energy is not None and steering.airborne:
            self._energy.fly(state, speed_mps, heading_rad, height_m, accel_mps2, turn_rate_max_rps)
        else:
            if self._prompt < 1.0:
                speed_mps = self._speed_reference(speed_mps)
            if steering.takes_off and self._full_throttle is not None:
                self._climb_out(self._full_throttle)
            else:
                advance(state, self.model, speed_mps, heading_rad, height_m, LOOP_S, accel_mps2, turn_rate_max_rps)
            if self._energy is not None:
                self._energy.roll(state, speed_mps, heading_rad, height_m)
        state.height_m -= self.drift_down_mps * LOOP_S
        if state.height_m < 0.0:
            state.height_m = state.climb_mps = 0.0
        self.turn_rate_radps = (state.heading_rad - before_rad) / LOOP_S

    def _acting(self) -> Setpoints:
        """Return the setpoints that act in this cycle, by its dead time later than they were commanded."""
        steering = self.steering
        accel_mps2, lateral_mps2 = steering.accel_mps2, steering.lateral_mps2
        newest = self.speed_commanded_mps, self.heading_commanded_rad, self.height_commanded_m, accel_mps2, lateral_mps2
        if self._waiting is None:
            return newest
        self._waiting.append(newest)
        return self._waiting.popleft()

    def _climb_out(self, model: AutopilotModel) -> None:
        """Roll, or once airborne climb, for a cycle with full throttle, without levelling off."""
        height_m = self.height_commanded_m
        if self.steering.airborne:
            height_m += model.climb_max_mps * (model.tau_ha_s + model.tau_hb_s)
        advance(self.state, model, model.speed_max_mps, self.heading_commanded_rad, height_m, LOOP_S)

    def _speed_reference(self, speed_mps: float) -> float:
        """Return the airspeed approached at present: prompt share of the command plus integrator."""
        if self.steering.takes_off or not self.steering.airborne:
            self._rest_mps = speed_mps
            return speed_mps
        rest_mps = self._rest_mps
        self._rest_mps = rest_mps + self._filled * (speed_mps - rest_mps)
        return self._prompt * speed_mps + (1.0 - self._prompt) * rest_mps

    def _drift(self) -> None:
        """Apply the air's velocity while airborne."""
        state = self.state
        if self.steering.airborne:
            north_mps, east_mps, down_mps = self.unknown_mps
            state.wind_north_mps, state.wind_east_mps = self.air_north_mps + north_mps, self.air_east_mps + east_mps
            self.drift_down_mps = self.air_down_mps + down_mps
        else:
            if state.airspeed_mps >= STANDING_MPS and (state.wind_north_mps != 0.0 or state.wind_east_mps != 0.0):
                self._touch_down()
            state.wind_north_mps = state.wind_east_mps = self.drift_down_mps = 0.0

    def _touch_down(self) -> None:
        """Roll on as it came over the ground: its nose turns to its course, and the wind no longer carries it.

        On the ground `airspeed_mps` is the speed over ground.
        """
        state = self.state
        north_mps, east_mps, _ = self.ground_velocity()
        off_rad = math.remainder(math.atan2(east_mps, north_mps) - state.heading_rad, math.tau)
        state.airspeed_mps, state.heading_rad = math.hypot(north_mps, east_mps), state.heading_rad + off_rad

    def _take_setpoints(self) -> None:
        """Take this cycle's setpoints from the steering; on the ground the height is kept, at rest also the heading."""
        state, steering, model = self.state, self.steering, self.model
        if steering.stopped:
            self.speed_commanded_mps, self.heading_commanded_rad = 0.0, state.heading_rad
        else:
            self.speed_commanded_mps = within(steering.speed_mps, model.speed_min_mps, model.speed_max_mps)
            if self.pitot is not None:
                self.speed_commanded_mps = self.pitot.true(self.speed_commanded_mps, state.height_m)
            self.heading_commanded_rad = steering.heading_rad(state, model.tau_psi_s + self._dead_s)
        self.height_commanded_m = steering.height_m if steering.airborne else state.height_m

    def _build_motion(self) -> Motion:
        state = self.state
        north_mps, east_mps, down_mps = self.ground_velocity()
        return Motion(
            state.north_m,
            state.east_m,
            state.height_m,
            state.climb_mps,
            state.airspeed_mps,
            state.heading_rad,
            north_mps,
            east_mps,
            down_mps,
            state.wind_north_mps,
            state.wind_east_mps,
            self.drift_down_mps,
            self.turn_rate_radps,
            self.speed_commanded_mps,
            self.heading_commanded_rad,
            self.height_commanded_m,
        )
