"""N emulated vehicles as one engine with one timer: the main loop of 50 Hz."""

from __future__ import annotations

from collections.abc import Callable, Mapping

from airlink.clock import Instant, after
from airlink.endpoint import Endpoint
from airlink.engine import Datagram, Engine
from formation_scenario.vehicles import Family
from sim_vehicles.airframe.body import Body
from sim_vehicles.airframe.disturbances import Environment
from sim_vehicles.airframe.hovering import HoveringBody
from sim_vehicles.board_clock import LOOP_S
from sim_vehicles.config import FleetConfig
from sim_vehicles.copter import Copter
from sim_vehicles.plane import Plane
from sim_vehicles.px4_plane_and_copter import Px4Copter, Px4Plane
from sim_vehicles.vehicle import Vehicle

KINDS: Mapping[Family, type[Vehicle]] = {
    "arduplane": Plane,
    "arducopter": Copter,
    "px4_plane": Px4Plane,
    "px4_copter": Px4Copter,
}
TruthListener = Callable[[Instant, "Fleet"], None]


class Fleet(Engine):
    """Flies all vehicles; each has a socket of its own.

    A cycle of the main loop moves the vehicles to its instant, handles what has arrived, so that replies are sent on
    the loop as a real autopilot's are, and sends what is due. A late timer catches up cycle by cycle. For autopilots
    with a faster loop only TIMESYNC is answered on arrival, because delays are measured by it.
    """

    def __init__(self, config: FleetConfig, now: Instant = Instant(0), truth: TruthListener | None = None) -> None:
        """Boot every vehicle at `now`; `truth` is called after each cycle."""
        self.config = config
        self.origin = config.origin
        self.bodies = [
            (HoveringBody if vehicle.model.hovers else Body)(vehicle, config.wind_mps, config.seed)
            for vehicle in config.vehicles
        ]
        self.environment = Environment(config, self.bodies)
        self._truth = truth
        self._outbox: list[Datagram] = []
        self._next_turn = after(now, LOOP_S)
        self.vehicles = [
            KINDS[each.family](i, config, self.bodies[i], self.environment, now)
            for i, each in enumerate(config.vehicles)
        ]

    def endpoints(self) -> tuple[Endpoint, ...]:
        """Return each vehicle's own end of its link."""
        return tuple(vehicle.endpoint for vehicle in self.config.vehicles)

    def receive(self, datagrams: list[Datagram], now: Instant) -> None:
        """Queue datagrams for their vehicles' next cycles."""
        for datagram in datagrams:
            vehicle = self.vehicles[datagram.socket]
            vehicle.receive(datagram, now)
            self._post(vehicle.link.outbox)

    def datagrams_to_send(self) -> list[Datagram]:
        """Remove and return the datagrams to send now."""
        if not self._outbox:
            return []
        out = self._outbox.copy()
        self._outbox.clear()
        return out

    def next_timer(self) -> Instant:
        """Return the instant of the loop's next cycle."""
        return self._next_turn

    def handle_timer(self, now: Instant) -> None:
        """Run every cycle that is due."""
        while self._next_turn <= now:
            self._turn(self._next_turn)
            self._next_turn = after(self._next_turn, LOOP_S)

    def _turn(self, now: Instant) -> None:
        for _at_s, ends, fault, hit in self.environment.advance(now):
            for vehicle in self.vehicles:
                if vehicle.config.identity in hit:
                    vehicle.inject(fault, now, ends=ends)
        for body in self.bodies:
            body.fly()
        # Stage by stage for all: the code of a stage stays in a processor's cache, that of all stages doesn't fit.
        awake = list[Vehicle]()
        for vehicle in self.vehicles:
            if vehicle.wake <= now and vehicle.act(now):
                awake.append(vehicle)
        streaming = list[Vehicle]()
        for vehicle in awake:
            if vehicle.tell():
                streaming.append(vehicle)
        while streaming:
            streaming = [vehicle for vehicle in streaming if vehicle.stream()]
        for vehicle in awake:
            vehicle.plan()
            self._post(vehicle.link.outbox)
        if self._truth is not None:
            self._truth(now, self)

    def _post(self, sent: list[Datagram]) -> None:
        """Send what a vehicle has sent."""
        if sent:
            self._outbox += sent
            sent.clear()
