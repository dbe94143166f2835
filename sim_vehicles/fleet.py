"""N emulated vehicles as one engine with one timer: the main loop of 50 Hz."""

from __future__ import annotations

from collections.abc import Callable

from airlink.clock import Instant, after
from airlink.endpoint import Endpoint, VehicleId
from airlink.engine import Datagram, Engine
from formation_scenario.extensions import ExtensionError, Registered, line_in
from sim_vehicles.airframe.body import Body
from sim_vehicles.airframe.environment import Environment
from sim_vehicles.airframe.hovering import HoveringBody
from sim_vehicles.board_clock import LOOP_S
from sim_vehicles.config import FleetConfig
from sim_vehicles.families import family_named
from sim_vehicles.vehicle import Vehicle

TruthListener = Callable[[Instant, "Fleet"], None]


class Fleet(Engine):
    """Flies all vehicles; each has a socket of its own for each of its links.

    A cycle of the main loop moves the vehicles to its instant, handles what has arrived, so that replies are sent on
    the loop as a real autopilot's are, and sends what is due. A late timer catches up cycle by cycle. For autopilots
    with a faster loop only TIMESYNC is answered on arrival, because delays are measured by it.
    """

    def __init__(self, config: FleetConfig, now: Instant = Instant(0), truth: TruthListener | None = None) -> None:
        """Boot every vehicle at `now`; `truth` is called after each cycle.

        Raises:
            ExtensionError: an extension can't begin.
        """
        self.config = config
        self.origin = config.origin
        self.bodies = [
            (HoveringBody if vehicle.model.hovers else Body)(vehicle, config.wind_mps, config.seed)
            for vehicle in config.vehicles
        ]
        self._indices = {vehicle.identity: index for index, vehicle in enumerate(config.vehicles)}
        self.environment = Environment(config, self.bodies)
        self._truth = truth
        self._outbox: list[Datagram] = []
        self._suffering = list[Vehicle]()
        """Vehicles with a fault that acts in each cycle."""
        self._next_turn = after(now, LOOP_S)
        self.vehicles = [
            self._booted(each.own_family or family_named(each.family), index, now)
            for index, each in enumerate(config.vehicles)
        ]
        self._wandering = [vehicle for vehicle in self.vehicles if vehicle.wanders]
        """Vehicles whose control loops fly by an estimate that is wrong."""
        at = {socket: each for index, each in enumerate(self.vehicles) for socket in config.sockets_of(index)}
        self._at_socket = [at[socket] for socket in range(len(at))]
        """The vehicle of each socket."""

    def index_of(self, vehicle: VehicleId) -> int:
        """Return a vehicle's index."""
        return self._indices[vehicle]

    @property
    def failure(self) -> str | None:
        """What failed of the extensions, in words; None if nothing did."""
        return self.environment.failures.first

    def endpoints(self) -> tuple[Endpoint, ...]:
        """Return each vehicle's own end of its link, then those of further links."""
        vehicles = self.config.vehicles
        further = (each for vehicle in vehicles for each in vehicle.further_endpoints)
        return (*(vehicle.endpoint for vehicle in vehicles), *further)

    def receive(self, datagrams: list[Datagram], now: Instant) -> None:
        """Queue datagrams for their vehicles' next cycles."""
        for datagram in datagrams:
            vehicle = self._at_socket[datagram.socket]
            try:
                vehicle.receive(datagram, now)
            except Exception as error:  # a family from outside may raise anything; what ours raises goes on
                if not self._failed(error):
                    raise
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
            try:
                self._turn(self._next_turn)
            except Exception as error:  # the same
                if not self._failed(error):
                    raise
            self._next_turn = after(self._next_turn, LOOP_S)

    def _turn(self, now: Instant) -> None:
        for _at_s, ends, fault, hit in self.environment.advance(now):
            for vehicle in self.vehicles:
                if vehicle.config.identity in hit:
                    vehicle.inject(fault, now, ends=ends)
            self._suffering = [vehicle for vehicle in self.vehicles if vehicle.faults.acting]
        self._move(now)
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

    def _move(self, now: Instant) -> None:
        """Let what pushes vehicles act, and all fly for a cycle."""
        for vehicle in self._suffering:
            vehicle.now = now
            vehicle.faults.act()
        for vehicle in self._wandering:
            vehicle.wander(now)
        for body in self.bodies:
            body.fly()

    def _booted(self, family: Registered, index: int, now: Instant) -> Vehicle:
        """Return a vehicle of a family that has booted.

        Raises:
            ExtensionError: the family is an extension's, and can't begin.
        """
        try:
            vehicle: Vehicle = family.made(index, self.config, self.bodies[index], self.environment, now)
        except Exception as error:  # of a family from outside; what ours raises goes on
            if family.origin.sha256 and not isinstance(error, ExtensionError):
                raise ExtensionError(f"the {family} can't begin: {family.describe_error(error)}") from error
            raise
        return vehicle

    def _failed(self, error: Exception) -> bool:
        """Note what a family of an extension did wrong, and silence its vehicles; return False for an error of ours."""
        found = False
        for vehicle in self.vehicles:
            family = vehicle.config.own_family
            if family is not None and line_in(error, family.origin.file) is not None:
                self.environment.failures.add_error(family, family.describe_error(error))
                vehicle.freeze(self, on=True)
                found = True
        return found
