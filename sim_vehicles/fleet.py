"""N emulated vehicles as one engine with one timer: the main loop of 50 Hz."""

from __future__ import annotations

from collections.abc import Callable

import numpy as np

from airlink.clock import Instant, after
from airlink.endpoint import Address, Endpoint
from airlink.engine import Datagram
from airlink.geodesy import GeodeticOrigin
from sim_vehicles.config import Airframe, FleetConfig
from sim_vehicles.dynamics import Array, Parameters, State, step
from sim_vehicles.environment import Environment
from sim_vehicles.modes import Condition
from sim_vehicles.steering import Steering
from sim_vehicles.streams import LOOP_HZ
from sim_vehicles.vehicle import Vehicle

LOOP_S = 1.0 / LOOP_HZ

TruthListener = Callable[[Instant, "Fleet"], None]


class Fleet:
    """Flies all vehicles; each has a socket of its own.

    A turn of the loop flies the vehicles on to its instant, then takes what has arrived (replies leave on the loop, as
    a real autopilot's do), then sends what is due. A timer that comes late catches up turn by turn.
    """

    def __init__(self, config: FleetConfig, now: Instant = Instant(0), truth: TruthListener | None = None) -> None:
        """Boot every vehicle at `now`; `truth` is called after each turn."""
        self.config = config
        self.origin = GeodeticOrigin(config.origin_lat_rad, config.origin_lon_rad, config.origin_alt_m)
        airframes = [vehicle.airframe for vehicle in config.vehicles]
        self.steering = Steering(airframes, config.cruise_mps)
        self.environment = Environment(config)
        self.state = _start_state(config)
        self.parameters = _parameters(airframes)
        self.drift_mps: Array = np.zeros((3, len(airframes)))
        self.command = self.steering.commands(self.state, self.parameters, self.drift_mps)
        self.turn_rate_rps: Array = np.zeros(len(airframes))
        self._truth = truth
        self._out: list[Datagram] = []
        self._next_turn = after(now, LOOP_S)
        self.vehicles = [Vehicle(i, vehicle, self, now) for i, vehicle in enumerate(config.vehicles)]

    def endpoints(self) -> tuple[Endpoint, ...]:
        """Return each vehicle's own end of its link."""
        return tuple(vehicle.endpoint for vehicle in self.config.vehicles)

    def receive(self, datagram: Datagram, now: Instant) -> None:  # noqa: ARG002 - acted on at the next turn
        """Keep a datagram for its vehicle's next turn."""
        self.vehicles[datagram.socket].receive(datagram.peer, datagram.data)

    def datagrams_to_send(self) -> list[Datagram]:
        """Return what is to be sent now, and forget it."""
        out, self._out = self._out, []
        return out

    def next_timer(self) -> Instant:
        """Return the next turn of the loop."""
        return self._next_turn

    def handle_timer(self, now: Instant) -> None:
        """Take every turn that is due."""
        while self._next_turn <= now:
            self._turn(self._next_turn)
            self._next_turn = after(self._next_turn, LOOP_S)

    def send(self, index: int, peer: Address, raw: bytes) -> None:
        """Queue a frame of a vehicle's."""
        self._out.append(Datagram(index, peer, raw))

    def _turn(self, now: Instant) -> None:
        for fault in self.environment.advance(now):
            for vehicle in self.vehicles:
                if vehicle.config.identity in fault.vehicles:
                    vehicle.strike(fault.kind, now)
        self._fly()
        for vehicle in self.vehicles:
            vehicle.turn(now)
        if self._truth is not None:
            self._truth(now, self)

    def _fly(self) -> None:
        """Fly everyone on by a turn; what stands on the ground stays there."""
        airborne = ~self.steering.stopped
        if not airborne.any():
            return
        self.drift_mps = self.environment.velocity_mps * airborne
        self.command = self.steering.commands(self.state, self.parameters, self.drift_mps)
        before = self.state.heading_rad
        self.state = step(self.state, self.command, self.parameters, self.drift_mps, LOOP_S)
        self.turn_rate_rps = (self.state.heading_rad - before) / LOOP_S
        crashed = [v.index for v in self.vehicles if v.pilot.condition is Condition.CRASHED]
        if crashed:
            self._ground(crashed)

    def _ground(self, crashed: list[int]) -> None:
        self.state.airspeed_mps[crashed] = 0.0
        self.state.climb_mps[crashed] = 0.0
        self.state.height_m[crashed] = 0.0


def _start_state(config: FleetConfig) -> State:
    starts = [vehicle.start for vehicle in config.vehicles]
    return State(
        north_m=np.array([start.north_m for start in starts], dtype=np.float64),
        east_m=np.array([start.east_m for start in starts], dtype=np.float64),
        height_m=np.array([start.height_m for start in starts], dtype=np.float64),
        climb_mps=np.zeros(len(starts)),
        airspeed_mps=np.array([start.airspeed_mps for start in starts], dtype=np.float64),
        heading_rad=np.array([start.heading_rad for start in starts], dtype=np.float64),
    )


def _parameters(airframes: list[Airframe]) -> Parameters:
    names = Parameters.__dataclass_fields__
    return Parameters(**{name: np.array([getattr(each, name) for each in airframes]) for name in names})
