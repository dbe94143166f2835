"""An emulated aircraft under total-energy control: its own parameters, dead time and airspeed sensor."""

from __future__ import annotations

import math
from collections import deque

import numpy as np

from airlink.random_streams import random_stream
from flight_model import energy
from flight_model.autopilot import FlightState
from flight_model.energy import GRAVITY_MPS2, PHYSICAL, AirframeParameters
from formation_scenario.vehicles import EnergyAirframe
from sim_vehicles.autopilot.clock import LOOP_S
from sim_vehicles.config import VehicleConfig

LEAST_SHARE = 0.2
"""A drawn parameter is at least this share of its mean."""
BLOCK = 256


class EnergyFlight:
    """Flies one aircraft; its parameters are drawn about its kind's."""

    def __init__(
        self, keys: EnergyAirframe, parameters: AirframeParameters, state: FlightState, random: np.random.Generator
    ) -> None:
        """Trim it; `random` gives its sensor's errors."""
        self._keys, self._parameters, self._random = keys, parameters, random
        self._aircraft = energy.Aircraft(state.height_m, state.climb_mps, state.airspeed_mps, state.heading_rad)
        energy.trim(self._aircraft, parameters)
        self._cycle = 0
        self._noise_mps: list[float] = []
        self._period = max(1, round(1.0 / (keys.airspeed_rate_hz * LOOP_S)))
        level = energy.Told(state.airspeed_mps, math.inf, state.heading_rad, math.inf, state.height_m)
        wait = 1 + round(parameters.dead_time_s / LOOP_S)
        self._told: deque[energy.Told] = deque([level] * wait, maxlen=wait)
        """Commands of the dead time, the oldest first."""
        self.shown_mps = state.airspeed_mps
        """Airspeed as telemetry tells it."""

    def fly(
        self,
        state: FlightState,
        speed_mps: float,
        heading_rad: float,
        height_m: float,
        accel_max_mps2: float,
        turn_rate_max_rps: float,
    ) -> None:
        """Move `state` on by a cycle of the main loop."""
        aircraft = self._aircraft
        self._load(state)
        bank_rad = math.atan(turn_rate_max_rps * max(state.airspeed_mps, energy.LEAST_MPS) / GRAVITY_MPS2)
        self._told.append(energy.Told(speed_mps, accel_max_mps2, heading_rad, bank_rad, height_m))
        told = self._told[0]
        if self._cycle % energy.CYCLES == 0:
            energy.control(aircraft, told, self._parameters)
        north_mps, east_mps = _along(state)
        energy.cycle(aircraft, told, self._parameters, self._noise())
        state.height_m, state.climb_mps = aircraft.height_m, aircraft.climb_mps
        state.airspeed_mps, state.heading_rad = aircraft.speed_mps, aircraft.heading_rad
        then_north_mps, then_east_mps = _along(state)
        state.north_m += LOOP_S * ((north_mps + then_north_mps) / 2.0 + state.wind_north_mps)
        state.east_m += LOOP_S * ((east_mps + then_east_mps) / 2.0 + state.wind_east_mps)
        self._show()

    def roll(self, state: FlightState, speed_mps: float, heading_rad: float, height_m: float) -> None:
        """Take note of a cycle on the ground, where it rolls as the model does."""
        self._load(state)
        energy.trim(self._aircraft, self._parameters)
        self._noise()  # the sensor's, which nothing reads here
        self._told.append(energy.Told(speed_mps, math.inf, heading_rad, math.inf, height_m))
        self._show()

    def _load(self, state: FlightState) -> None:
        aircraft = self._aircraft
        aircraft.height_m, aircraft.climb_mps = state.height_m, state.climb_mps
        aircraft.speed_mps, aircraft.heading_rad = state.airspeed_mps, state.heading_rad

    def _noise(self) -> float:
        """Return the next of the sensor's white errors, m/s."""
        if not self._noise_mps:
            self._noise_mps = self._random.standard_normal(BLOCK)[::-1].tolist()
        return self._keys.airspeed_noise_mps * self._noise_mps.pop()

    def _show(self) -> None:
        """Take the sensor's airspeed into telemetry where a new one is due."""
        self._cycle += 1
        if self._cycle % self._period == 0:
            step_mps, sensed_mps = self._keys.airspeed_step_mps, self._aircraft.sensed
            self.shown_mps = round(sensed_mps / step_mps) * step_mps if step_mps > 0.0 else sensed_mps


def energy_flight(config: VehicleConfig, state: FlightState, seed: int) -> EnergyFlight | None:
    """Return the flight of a vehicle that has an airframe, None for one that flies by equation (7)."""
    keys = config.model.airframe
    if keys is None:
        return None
    random = np.random.Generator(np.random.Philox(random_stream(seed, "airframe", *config.identity)))
    values = keys.parameters()
    for name in PHYSICAL:
        values[name] *= max(1.0 + keys.spread * float(random.standard_normal()), LEAST_SHARE)
    return EnergyFlight(keys, AirframeParameters.of(values), state, random)


def _along(state: FlightState) -> tuple[float, float]:
    """Return the airspeed's components north and east."""
    return state.airspeed_mps * math.cos(state.heading_rad), state.airspeed_mps * math.sin(state.heading_rad)
