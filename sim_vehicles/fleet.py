"""N emulated vehicles as one engine with one timer: the main loop of 50 Hz."""

from __future__ import annotations

from collections.abc import Callable

import numpy as np

from airlink.clock import Instant, after
from airlink.endpoint import Endpoint
from airlink.engine import Datagram
from flight_model.arrays import Array
from flight_model.earth import GeodeticOrigin
from sim_vehicles.airframe.airframes import Airframes, Steering
from sim_vehicles.airframe.dynamics import Command, State
from sim_vehicles.airframe.environment import Environment
from sim_vehicles.airframe.motion import MotionTable
from sim_vehicles.autopilot.clock import LOOP_S
from sim_vehicles.config import FleetConfig
from sim_vehicles.vehicle import Vehicle

STANDING_MPS = 1e-3

TruthListener = Callable[[Instant, "Fleet"], None]


class Fleet:
    """Flies all vehicles; each has a socket of its own.

    A cycle of the main loop moves the vehicles to its instant, then handles what has arrived (so replies are sent on
    the loop, as a real autopilot's are), then sends what is due. A late timer catches up cycle by cycle.
    """

    def __init__(self, config: FleetConfig, now: Instant = Instant(0), truth: TruthListener | None = None) -> None:
        """Boot every vehicle at `now`; `truth` is called after each cycle."""
        self.config = config
        self.origin = GeodeticOrigin(config.origin_lat_rad, config.origin_lon_rad, config.origin_alt_m)
        models = [vehicle.model for vehicle in config.vehicles]
        self.steering = Steering(models)
        self.environment = Environment(config)
        self.state = _start_state(config)
        self.drift_mps: Array = np.zeros((3, len(models)))
        self.airframes = Airframes(config, self.state)
        self._truth = truth
        self.outbox: list[Datagram] = []
        self._next_turn = after(now, LOOP_S)
        self.turn_rate_radps: Array = np.zeros(len(models))
        self.motions = self._motions(self.steering.commands(self.state, self.airframes.parameters, self.drift_mps))
        self.vehicles = [Vehicle(i, vehicle, self, now) for i, vehicle in enumerate(config.vehicles)]

    def endpoints(self) -> tuple[Endpoint, ...]:
        """Return each vehicle's own end of its link."""
        return tuple(vehicle.endpoint for vehicle in self.config.vehicles)

    def receive(self, datagram: Datagram, now: Instant) -> None:
        """Keep a datagram for its vehicle's next cycle."""
        self.vehicles[datagram.socket].receive(datagram.peer, datagram.data, now)

    def datagrams_to_send(self) -> list[Datagram]:
        """Remove and return the datagrams to send now."""
        out = self.outbox.copy()
        self.outbox.clear()
        return out

    def next_timer(self) -> Instant:
        """Return the instant of the loop's next cycle."""
        return self._next_turn

    def handle_timer(self, now: Instant) -> None:
        """Run every cycle that is due."""
        while self._next_turn <= now:
            self._turn(self._next_turn)
            self._next_turn = after(self._next_turn, LOOP_S)

    def ground(self, index: int) -> None:
        """Put a vehicle on the ground, at rest."""
        self.state.table[2:5, index] = 0.0

    def _turn(self, now: Instant) -> None:
        for fault in self.environment.advance(now, self.state):
            for vehicle in self.vehicles:
                if vehicle.config.identity in fault.vehicles:
                    vehicle.strike(fault, now)
        self._fly()
        for vehicle in self.vehicles:
            if vehicle.wake <= now:
                vehicle.turn(now)
        if self._truth is not None:
            self._truth(now, self)

    def _fly(self) -> None:
        """Move all vehicles by one cycle; those that stand on the ground stay there."""
        self.drift_mps = self.environment.velocity_mps * self.steering.airborne
        before = self.state
        if not np.count_nonzero(~self.steering.stopped) and (before.airspeed_mps < STANDING_MPS).all():
            return
        command = self.steering.commands(before, self.airframes.parameters, self.drift_mps)
        self.state = self.airframes.step(before, command, self.drift_mps, self.steering.airborne)
        below = self.state.height_m < 0.0
        if np.count_nonzero(below):
            self.state.table[2:4, below] = 0.0
        self.turn_rate_radps = (self.state.heading_rad - before.heading_rad) / LOOP_S
        self.motions = self._motions(command)

    def _motions(self, command: Command) -> MotionTable:
        return MotionTable(self.state, command, self.drift_mps, self.turn_rate_radps)


def _start_state(config: FleetConfig) -> State:
    starts = [vehicle.start for vehicle in config.vehicles]
    columns = [(s.north_m, s.east_m, s.height_m, 0.0, s.airspeed_mps, s.heading_rad) for s in starts]
    return State(np.array(columns, dtype=np.float64).T.copy())
