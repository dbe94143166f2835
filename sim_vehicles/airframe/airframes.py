"""How every vehicle of a fleet moves: how it is steered, by model (7) or under total-energy control."""

from __future__ import annotations

import numpy as np

from airlink.random_streams import random_stream
from flight_model import energy
from flight_model.airframe import PHYSICAL, AirframeParameters
from flight_model.arrays import Array, Indices, Mask
from formation_scenario.vehicles import EnergyAirframe, VehicleModel
from sim_vehicles.airframe.dynamics import Command, Parameters, State, step
from sim_vehicles.autopilot.clock import LOOP_S
from sim_vehicles.config import FleetConfig, VehicleConfig

HEADING, COURSE, CIRCLE = 0, 1, 2
CAPTURE = 2.0
"""Steepness of the approach to a circle: radians off the tangent per radius of distance from it."""
ON_CIRCLE_RAD = 1.0
"""Closer to the tangent than this, the heading setpoint leads by the heading's lag in the turn."""
LEAST_SPEED_MPS = 1.0
"""Lower bound of airspeeds in divisions, for vehicles that stand still."""
MOTION = slice(2, 6)
"""Rows of `State` that an airframe moves: height, climb, airspeed, heading."""
LEAST_SHARE = 0.2
"""A drawn parameter is at least this share of its mean."""


class Steering:
    """Targets of N vehicles. Each vehicle writes its own elements; the main loop reads them all."""

    def __init__(self, models: list[VehicleModel]) -> None:
        """Start with all vehicles at rest."""
        count = len(models)
        self.kind = np.zeros(count, dtype=np.int8)
        self._told = np.zeros((2, count))
        self.height_m: Array = np.zeros(count)
        self.accel_mps2: Array = np.full(count, np.inf)
        self.lateral_mps2: Array = np.full(count, np.inf)
        self.centre_m: Array = np.zeros((2, count))
        self.radius_m: Array = np.ones(count)
        self.stopped = np.ones(count, dtype=np.bool_)
        """Throttle at 0."""
        self.airborne = np.zeros(count, dtype=np.bool_)
        self._speed_min_mps = np.array([each.speed_min_mps for each in models])
        self._speed_max_mps = np.array([each.speed_max_mps for each in models])

    @property
    def speed_mps(self) -> Array:
        """(N,) airspeeds; a view, not kept beside the table: in a copy of a fleet it would be another array."""
        return self._told[0]

    @property
    def direction_rad(self) -> Array:
        """(N,) headings or courses, a view likewise."""
        return self._told[1]

    def commands(self, state: State, parameters: Parameters, drift_mps: Array) -> Command:
        """Return the model's commands for this cycle; vehicles on the ground stay there."""
        air_motion = self._told.copy()
        speed, heading = air_motion
        if np.count_nonzero(self.kind):
            heading[:] = np.where(self.kind == CIRCLE, self._round(state, parameters), heading)
            heading[:] = np.where(self.kind == HEADING, heading, heading - _crab(heading, state, drift_mps))
        np.minimum(np.maximum(speed, self._speed_min_mps), self._speed_max_mps, out=speed)
        height_m = self.height_m
        if np.count_nonzero(self.stopped):
            speed[self.stopped] = 0.0
            heading[self.stopped] = state.heading_rad[self.stopped]
        if np.count_nonzero(self.airborne) < self.airborne.size:
            height_m = np.where(self.airborne, height_m, state.height_m)
        turn_rate = self.lateral_mps2 / np.maximum(state.airspeed_mps, LEAST_SPEED_MPS)
        return Command(air_motion, np.array((self.accel_mps2, turn_rate)), height_m)

    def _round(self, state: State, parameters: Parameters) -> Array:
        """Return the courses (N,) that lead onto the clockwise circles and along them."""
        north, east = state.table[:2] - self.centre_m
        off = CAPTURE * (np.hypot(north, east) / self.radius_m - 1.0)
        off = np.minimum(np.maximum(off, -np.pi / 2), np.pi / 2)
        tangent = np.arctan2(east, north) + np.pi / 2
        ahead = parameters.tau_s[1] * state.airspeed_mps / self.radius_m
        return tangent + off + np.where(np.abs(off) < ON_CIRCLE_RAD, ahead, 0.0)


def _crab(course: Array, state: State, drift_mps: Array) -> Array:
    """Return the crab angle (N,): how far left of the course the heading must point to cancel the drift across it."""
    aside = drift_mps[1] * np.cos(course) - drift_mps[0] * np.sin(course)
    share = aside / np.maximum(state.airspeed_mps, LEAST_SPEED_MPS)
    return np.arcsin(np.minimum(np.maximum(share, -1.0), 1.0))


class Airframes:
    """Moves N vehicles by a cycle of the main loop. Without any airframe this is `dynamics.step`."""

    def __init__(self, config: FleetConfig, state: State) -> None:
        """Trim the aircraft that start in the air."""
        self.parameters = Parameters.of([vehicle.model for vehicle in config.vehicles], LOOP_S)
        flown = [(i, each.model.airframe) for i, each in enumerate(config.vehicles)]
        self._aircraft = [
            _Aircraft(index, keys, config.vehicles[index], config.seed) for index, keys in flown if keys is not None
        ]
        self._which: Indices = np.array([each.index for each in self._aircraft], dtype=np.intp)
        self._column = {each.index: column for column, each in enumerate(self._aircraft)}
        if not self._aircraft:
            return
        self._airframe = AirframeParameters.of([each.parameters for each in self._aircraft])
        self._inner: Array = energy.trimmed(state.table[MOTION][:, self._which], self._airframe)
        self._cycle = 0
        waits = np.round(self._airframe.dead_time_s / LOOP_S).astype(np.intp)
        self._waits: list[int] = waits.tolist()
        level = state.table[MOTION][:, self._which]
        none = np.full(self._which.size, np.inf)
        self._told: list[Array] = [
            np.array((level[energy.SPEED], none, level[energy.HEADING], none, level[energy.HEIGHT]))
        ] * (1 + max(self._waits))
        """Commands (5, N) of the longest dead time, the newest last."""

    def step(self, state: State, command: Command, drift_mps: Array, airborne: Mask) -> State:
        """Return the state a cycle later; aircraft that aren't `airborne` (N,) roll as the model does."""
        moved = step(state, command, self.parameters, drift_mps)
        if self._aircraft:
            self._fly(state, moved, command, drift_mps, airborne[self._which])
        return moved

    def airspeed_mps(self, index: int) -> float | None:
        """Return a vehicle's airspeed as its own sensor last told it; None where that is exact."""
        column = self._column.get(index)
        return None if column is None else self._aircraft[column].shown_mps

    def _fly(self, state: State, moved: State, command: Command, drift_mps: Array, airborne: Mask) -> None:
        which, airframe = self._which, self._airframe
        motion = state.table[MOTION][:, which].copy()
        told = self._heeded(command, motion)
        if self._cycle % energy.CYCLES == 0:
            energy.control(motion, self._inner, told, airframe)
        self._cycle += 1
        noise_mps = np.array([each.noise_mps() for each in self._aircraft])
        before = motion[energy.SPEED] * _along(motion[energy.HEADING])
        energy.cycle(motion, self._inner, told, airframe, noise_mps)
        after = motion[energy.SPEED] * _along(motion[energy.HEADING])
        table = np.empty((6, which.size))
        drift = drift_mps[:, which]
        table[:2] = state.table[:2, which] + LOOP_S * ((before + after) / 2 + drift[:2])
        table[2:] = motion
        table[2] -= LOOP_S * drift[2]
        moved.table[:, which[airborne]] = table[:, airborne]
        rolling = ~airborne
        if rolling.any():
            self._inner[:, rolling] = energy.trimmed(moved.table[MOTION][:, which], airframe)[:, rolling]
        for column, each in enumerate(self._aircraft):
            each.show(self._cycle, float(self._inner[energy.R["sensed"], column]))

    def _heeded(self, command: Command, motion: Array) -> energy.Told:
        """Return the command of each aircraft's dead time ago."""
        which, speed = self._which, np.maximum(motion[energy.SPEED], energy.LEAST_MPS)
        bank = np.arctan(command.rate_max[1, which] * speed / energy.GRAVITY_MPS2)
        air, accel = command.air_motion[:, which], command.rate_max[0, which]
        self._told.append(np.array((air[0], accel, air[1], bank, command.height_m[which])))
        del self._told[: -1 - max(self._waits)]
        newest = len(self._told) - 1
        rows = [self._told[newest - wait][:, column] for column, wait in enumerate(self._waits)]
        return energy.Told(*np.array(rows).T)


class _Aircraft:
    """One aircraft: its own parameters, drawn about its kind's, and what its airspeed sensor tells."""

    def __init__(self, index: int, keys: EnergyAirframe, config: VehicleConfig, seed: int) -> None:
        self.index = index
        random = np.random.Generator(np.random.Philox(random_stream(seed, "airframe", *config.identity)))
        self.parameters = keys.parameters()
        for name in PHYSICAL:
            share = 1.0 + keys.spread * float(random.standard_normal())
            self.parameters[name] *= max(share, LEAST_SHARE)
        self._keys, self._random = keys, random
        self._period = max(1, round(1.0 / (keys.airspeed_rate_hz * LOOP_S)))
        self.shown_mps = config.start.airspeed_mps

    def noise_mps(self) -> float:
        """Return the next of the sensor's white errors."""
        return self._keys.airspeed_noise_mps * float(self._random.standard_normal())

    def show(self, cycle: int, sensed_mps: float) -> None:
        """Take the sensor's airspeed into telemetry where a new one is due."""
        if cycle % self._period == 0:
            step_mps = self._keys.airspeed_step_mps
            self.shown_mps = round(sensed_mps / step_mps) * step_mps if step_mps > 0 else sensed_mps


def _along(heading_rad: Array) -> Array:
    return np.array((np.cos(heading_rad), np.sin(heading_rad)))
