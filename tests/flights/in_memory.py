"""A station and emulated vehicles on an in-memory network, and engines that go between them."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import replace
from typing import Any

import numpy as np

from airlink.clock import NANOSECONDS, Instant, VirtualClock, after
from airlink.endpoint import Endpoint, VehicleId
from airlink.engine import Datagram, Engine, MemoryNetwork
from formation_scenario import Scenario, load_scenario
from formation_scenario.surroundings import Fault, FaultKind
from gcs_formation.app.link_injection import impair
from gcs_formation.app.signing import flight_signing
from gcs_formation.mission.gate import UNCHECKED, PreFlightOptions
from gcs_formation.recorder import Event, Tick
from gcs_formation.station import Station
from sim_vehicles.config import fleet_config
from sim_vehicles.fleet import Fleet
from tests.flights.conftest import scenario


class MemoryRecorder:
    """A recorder in memory. It ensures that nobody writes into a tick that it has taken."""

    def __init__(self) -> None:
        self.ticks: list[Tick] = []
        self.events: list[Event] = []

    def frames(self, now: Instant, raws: list[bytes]) -> None:
        """Keep nothing."""

    def tick(self, tick: Tick) -> None:
        """Keep a tick; whoever still writes into its lists raises a TypeError (compiled, its fields must be lists)."""
        self.ticks.append(tick)
        for name, value in getattr(tick, "__dict__", {}).items():
            if isinstance(value, list):
                setattr(tick, name, tuple(value))

    def event(self, event: Event) -> None:
        self.events.append(event)


class Between(Engine):
    """An engine around a fleet that passes everything on."""

    def __init__(self, fleet: Fleet) -> None:
        self.fleet = fleet

    def endpoints(self) -> tuple[Endpoint, ...]:
        return self.fleet.endpoints()

    def receive(self, datagrams: list[Datagram], now: Instant) -> None:
        for datagram in datagrams:
            self.take(datagram, now)

    def take(self, datagram: Datagram, now: Instant) -> None:
        self.fleet.receive([datagram], now)

    def datagrams_to_send(self) -> list[Datagram]:
        return self.fleet.datagrams_to_send()

    def next_timer(self) -> Instant | None:
        return self.fleet.next_timer()

    def handle_timer(self, now: Instant) -> None:
        self.fleet.handle_timer(now)


class HeldUp(Between):
    """Emulators on a machine that stops for a while: neither vehicles nor their clocks advance meanwhile."""

    def __init__(self, fleet: Fleet) -> None:
        super().__init__(fleet)
        self._lost_ns = 0
        self._until = Instant(0)
        self._waiting: list[Datagram] = []

    def stop(self, now: Instant, seconds: float) -> None:
        self._until = after(now, seconds)
        self._lost_ns += round(seconds * NANOSECONDS)

    def receive(self, datagrams: list[Datagram], now: Instant) -> None:
        if now < self._until:
            self._waiting.extend(datagrams)
        else:
            self.fleet.receive(datagrams, Instant(now - self._lost_ns))

    def next_timer(self) -> Instant | None:
        timer = self.fleet.next_timer()
        return None if timer is None else max(Instant(timer + self._lost_ns), self._until)

    def handle_timer(self, now: Instant) -> None:
        waiting, self._waiting = self._waiting, []
        self.receive(waiting, now)
        self.fleet.handle_timer(Instant(now - self._lost_ns))


class Sleeper(Engine):
    """A station whose process is stopped for a while; datagrams wait in its sockets meanwhile."""

    def __init__(self, station: Engine) -> None:
        self._station = station
        self._waiting: list[Datagram] = []
        self._until = Instant(0)

    def replace(self, station: Engine) -> None:
        """Let another process take over the killed one's sockets; what arrived meanwhile is lost."""
        self._station, self._waiting, self._until = station, [], Instant(0)

    def stop(self, now: Instant, seconds: float) -> None:
        self._until = after(now, seconds)

    def endpoints(self) -> tuple[Endpoint, ...]:
        return self._station.endpoints()

    def receive(self, datagrams: list[Datagram], now: Instant) -> None:
        if now < self._until:
            self._waiting.extend(datagrams)
        else:
            self._station.receive(datagrams, now)

    def datagrams_to_send(self) -> list[Datagram]:
        return self._station.datagrams_to_send()

    def next_timer(self) -> Instant | None:
        timer = self._station.next_timer()
        return None if timer is None else max(timer, self._until)

    def handle_timer(self, now: Instant) -> None:
        """Receive what has arrived, then handle timers, as the UDP driver does when its process continues."""
        waiting, self._waiting = self._waiting, []
        self._station.receive(waiting, now)
        self._station.handle_timer(now)


class World:
    """A leader and two followers under the virtual clock, by default in the air on a straight path."""

    def __init__(
        self,
        between: type[Between] = Between,
        caution: PreFlightOptions = UNCHECKED,
        recorder: Callable[[Scenario], MemoryRecorder] = lambda _: MemoryRecorder(),
        around: Callable[[Engine, Station], Engine] = lambda engine, _: engine,
        **keys: Any,
    ) -> None:
        planned = load_scenario(scenario(**keys))
        self.recorder, self.clock = recorder(planned), VirtualClock()
        self.network, signing = MemoryNetwork(self.clock), flight_signing(planned, self.clock).links
        self.station = Station(planned, self.recorder, caution=caution, signing=signing)
        self.config = fleet_config(planned)
        self.fleet = Fleet(self.config)
        self.between = between(self.fleet)
        self.attach(self.between)
        self.process = Sleeper(around(impair(planned, self.station) or self.station, self.station))
        self.attach(self.process)

    def attach(self, engine: Engine) -> None:
        self.network.attach(engine)

    def stage(self, name: str) -> Any:
        """Return a stage of the station's control cycle."""
        return self.station.cycle.stage(name)

    def another(self, number: int, **changes: Any) -> Fleet:
        """Return a fleet of one vehicle with one of our system ids, booting now; it isn't attached yet."""
        twin = next(each for each in self.config.vehicles if each.identity.system == number)
        return Fleet(replace(self.config, vehicles=(replace(twin, **changes),)), self.clock.now())

    def run(self, seconds: float | None = None) -> None:
        """Run for a while, or to the end."""
        until = after(self.clock.now(), seconds or 1e6)
        self.network.run(lambda: self.station.flight.ended or self.clock.now() >= until)

    def fly_to(self, mission_s: float) -> None:
        """Run to a mission time."""
        self.network.run(
            lambda: self.station.flight.ended or self.station.flight.mission_time_s(self.clock.now()) >= mission_s
        )

    def vehicle(self, number: int) -> Any:
        """Return an emulated vehicle."""
        return self.fleet.vehicles[number - 1]

    def inject(self, number: int, kind: FaultKind, *, ends: bool = False, **keys: Any) -> None:
        """Begin or end a fault now."""
        self.vehicle(number).inject(Fault(at_s=0.0, kind=kind, **keys), self.clock.now(), ends=ends)

    def times_s(self, kind: str, number: int | None = None, text: str = "") -> list[float]:
        """Return the times of events of a kind, optionally of a vehicle, with `text` in them."""
        identity = None if number is None else VehicleId(1, number)
        return [
            event.now / NANOSECONDS
            for event in self.recorder.events
            if event.kind == kind and text in event.text and (number is None or event.vehicle == identity)
        ]

    def words(self, kind: str) -> list[str]:
        return [event.text for event in self.recorder.events if event.kind == kind]

    def worst_m(self, from_s: float = 5.0, to_s: float = 1e6) -> float:
        """Return the largest formation error in a window, as the law saw it."""
        errors = [tick.error_m[1:] for tick in self.recorder.ticks if from_s <= tick.mission_time_s <= to_s]
        return float(np.nanmax(np.abs(np.concatenate(errors))))

    @property
    def now_s(self) -> float:
        return self.clock.now() / NANOSECONDS
