"""A flight under the virtual clock whose ends receive hostile datagrams, and its result."""

from __future__ import annotations

import gc
import math
import random
import resource
import sys
from dataclasses import dataclass, field
from typing import Any, Literal

import numpy as np

from airlink import mavlink as m
from airlink.clock import Instant, VirtualClock, after
from airlink.endpoint import LOOPBACK, Address, Endpoint
from airlink.engine import FIRST_EPHEMERAL_PORT, Datagram, Engine, MemoryNetwork
from airlink.frame import HEADER_V2
from airlink.messages import KINDS
from airlink.messages.command import CommandInt
from airlink.messages.payload import MARKER_V2
from flight_model.arrays import Array
from formation_scenario import Scenario, load_scenario
from formation_scenario.vehicles import VehicleModel
from gcs_formation.app.link_injection import impair
from gcs_formation.app.signing import flight_signing
from gcs_formation.recorder import Event, Tick
from gcs_formation.station import Station
from gcs_formation.vehicle.autopilot_family import STATION
from sim_vehicles.config import fleet_config
from sim_vehicles.fleet import Fleet
from tests.flights.conftest import scenario
from tests.fuzz.datagrams import FOREIGN_TARGET, Hostile, Names

TURN_S = 0.02
STRANGERS = 5000
SYSTEMS = (1, 2, 3)

End = Literal["station", "vehicles"]


class MemoryRecorder:
    """A recorder that keeps what a flight is judged by."""

    def __init__(self) -> None:
        self.setpoints: list[Array] = []
        self.errors_m: list[Array] = []
        self.events: list[Event] = []
        self.commands: set[bytes] = set()

    def forget(self) -> None:
        """Begin anew."""
        for kept in (self.setpoints, self.errors_m, self.events, self.commands):
            kept.clear()

    def frames(self, now: Instant, raws: list[bytes]) -> None:
        """Keep the payloads of commands that the station sent; they are few, because only different ones are kept."""
        for raw in raws:
            message_id = int.from_bytes(raw[7:HEADER_V2], "little")
            if raw[0] == MARKER_V2 and raw[5] == STATION.system and message_id == m.MAVLINK_MSG_ID_COMMAND_INT:
                self.commands.add(raw[HEADER_V2 : HEADER_V2 + raw[1]])

    def tick(self, tick: Tick) -> None:
        """Keep setpoints, and errors while the path is flown."""
        self.setpoints.append(np.array(tick.setpoints))
        if tick.phase == "flying":
            self.errors_m.append(np.array(tick.error_m[1:]))

    def event(self, event: Event) -> None:
        """Keep it."""
        self.events.append(event)


class Besieged(Engine):
    """An engine that receives hostile datagrams every 20 ms, from its peers' addresses and from thousands of others."""

    def __init__(self, engine: Engine, peers: list[list[Address]], siege: Siege) -> None:
        """Attack `engine`; `peers` are the real peers of each of its sockets."""
        self.thrown = 0
        self._engine = engine
        self._hostile = siege.source()
        self._peers = peers
        self._siege = siege
        self._random = random.Random(siege.seed)
        self._next = Instant(0)

    def endpoints(self) -> tuple[Endpoint, ...]:
        """Return the engine's."""
        return self._engine.endpoints()

    def receive(self, datagrams: list[Datagram], now: Instant) -> None:
        """Hand on what is meant for it."""
        self._engine.receive(datagrams, now)

    def datagrams_to_send(self) -> list[Datagram]:
        """Return the engine's."""
        return self._engine.datagrams_to_send()

    def next_timer(self) -> Instant | None:
        """Return the engine's timer, or the next attack."""
        timer = self._engine.next_timer()
        return None if timer is None else min(timer, self._next)

    def handle_timer(self, now: Instant) -> None:
        """Send the datagrams that are due, then let the engine handle its timer."""
        if now >= self._next:
            self._next = after(now, TURN_S)
            for _ in range(self._siege.each_turn):
                self._engine.receive([self._throw()], now)
            self.thrown += self._siege.each_turn
        timer = self._engine.next_timer()
        if timer is not None and timer <= now:
            self._engine.handle_timer(now)

    def _throw(self) -> Datagram:
        draw = self._random
        socket = draw.randrange(len(self._peers))
        if draw.random() < self._siege.own_share:
            return Datagram(socket, draw.choice(self._peers[socket]), self._hostile.datagram())
        number = draw.randrange(STRANGERS)
        return Datagram(socket, Address(f"10.0.{number >> 8}.{number & 0xFF}", 14550), self._hostile.datagram())


@dataclass(frozen=True)
class Siege:
    """Which end is attacked, and with what."""

    seed: int = 1
    each_turn: int = 0
    end: End | None = None
    forged: bool = False
    forged_share: float = 0.5
    """Of forged frames among the datagrams, if there are any."""
    own_share: float = 0.0
    """Share of the datagrams that seem to come from a real peer's address."""
    links: dict[str, Any] = field(default_factory=dict[str, Any])

    def source(self) -> Hostile:
        """Return the source of datagrams; forged frames are in the names of the end's peers."""
        forged = Names(SYSTEMS, STATION.system) if self.end == "station" else Names((STATION.system,), SYSTEMS[0])
        return Hostile(self.seed, forged if self.forged else None, self.forged_share)


@dataclass
class Flown:
    """The result of a flight."""

    station: Station
    fleet: Fleet
    recorder: MemoryRecorder
    thrown: int
    kept: int
    """Objects alive at the end."""
    dropped: int
    """Rejected frames: at the ground station by its counts, at the vehicles by theirs."""
    peak_kib: tuple[int, int]
    """Peak memory of the process after a fifth of the time, and at the end."""


def planned(duration_s: float, links: dict[str, Any] | None = None) -> Scenario:
    """Return a leader and two followers on a straight path."""
    way_m = 22 * (duration_s + 60)
    path = {"speed_mps": 22, "waypoints_m": [[0, 0, 100], [way_m / 2, 0, 100], [way_m, 0, 100]]}
    start = {"in_air": True, "run_in_s": 6, "timeout_s": 30}
    return load_scenario(scenario(duration_s=duration_s, path=path, start=start, links=links or {}))


def fly(duration_s: float, siege: Siege) -> Flown:
    """Fly while one end is attacked; without an attack, the same flight undisturbed."""
    plan, clock, recorder = planned(duration_s, siege.links), VirtualClock(), MemoryRecorder()
    station = Station(plan, recorder, signing=flight_signing(plan, clock).links)
    fleet = Fleet(fleet_config(plan))
    vehicles = [Address(LOOPBACK, FIRST_EPHEMERAL_PORT + i) for i in range(len(plan.vehicles))]
    ground = station.endpoints()[0].address
    ends: dict[End, Engine] = {"vehicles": fleet, "station": impair(plan, station) or station}
    peers: dict[End, list[list[Address]]] = {"vehicles": [[ground]] * len(vehicles), "station": [vehicles]}
    wall = Besieged(ends[siege.end], peers[siege.end], siege) if siege.end else None
    network = MemoryNetwork(clock)
    for end, engine in ends.items():
        network.attach(wall if wall and end == siege.end else engine)
    peaks_kib: list[int] = []

    def over() -> bool:
        if not peaks_kib and clock.now() > after(Instant(0), duration_s / 5):
            peaks_kib.append(peak_kib())
        return station.flight.ended

    network.run(over)
    gc.collect()
    peaks = (peaks_kib or [peak_kib()])[0], peak_kib()
    dropped = station.received().bad + sum(vehicle.link.frames_bad for vehicle in fleet.vehicles)
    return Flown(station, fleet, recorder, wall.thrown if wall else 0, len(gc.get_objects()), dropped, peaks)


def peak_kib() -> int:
    """Return the peak memory of this process."""
    return resource.getrusage(resource.RUSAGE_SELF).ru_maxrss // (1024 if sys.platform == "darwin" else 1)


def check(flown: Flown) -> None:
    """Check what no datagram may break: commands and motion stay within the envelope."""
    models, default = flown.station.controller.models, VehicleModel()
    told = np.array(flown.recorder.setpoints).reshape(-1, len(models), 3)
    assert not np.isinf(told).any()
    assert np.array_equal(np.isnan(told[..., 0]), np.isnan(told).any(axis=-1)), "part of a setpoint"
    assert np.nanmin(told[..., 0], initial=np.inf) >= min(model.speed_min_mps for model in models)
    assert np.nanmax(told[..., 0], initial=-np.inf) <= max(model.speed_max_mps for model in models)
    for payload in flown.recorder.commands:
        fields = KINDS[m.MAVLINK_MSG_ID_COMMAND_INT].example.read(payload, 0, len(payload))
        assert isinstance(fields, CommandInt)
        if fields.target_system == FOREIGN_TARGET:
            continue  # sent to the station, which records what it receives
        assert all(math.isfinite(value) for value in fields.values().values() if isinstance(value, float)), fields
    for state in (body.state for body in flown.fleet.bodies):
        assert all(map(math.isfinite, state.values()))
        assert state.airspeed_mps <= default.speed_max_mps + 1e-9
        assert state.height_m >= 0.0


def worst_error_m(recorder: MemoryRecorder) -> float:
    """Return the largest formation error in the second half of a flight's path; NaN if no vehicle was commanded."""
    late = np.abs(np.array(recorder.errors_m[len(recorder.errors_m) // 2 :]))
    return float(np.fmax.reduce(late, axis=None, initial=np.nan)) if late.size else float("nan")
