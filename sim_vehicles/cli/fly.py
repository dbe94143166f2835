"""`sim-vehicles fly`, or `sim-vehicles` alone: runs a fleet over UDP under the real clock."""

from __future__ import annotations

import json
import os
import select
import signal
import sys
from contextlib import nullcontext
from dataclasses import replace
from pathlib import Path
from typing import Any

import click
from pydantic import TypeAdapter

from airlink.cli import SECONDS, Number, Status, WholeNumber, drop, fail
from airlink.clock import NANOSECONDS, Instant, RealClock
from airlink.driver import Driver
from airlink.endpoint import (
    LOOPBACK,
    MAX_PORT,
    Address,
    Endpoint,
    EndpointError,
    PortError,
    VehicleId,
    parse_endpoint,
)
from airlink.transports.udp import resolved
from formation_scenario import ScenarioError, load_scenario
from formation_scenario.extensions import ExtensionError
from formation_scenario.fields import MAX_SYSTEM_ID
from formation_scenario.origin import Origin
from formation_scenario.start_states import StartState
from formation_scenario.surroundings import Disturbance, Fault
from formation_scenario.vehicles import BASE_PORT
from sim_vehicles.airframe.environment import Environment
from sim_vehicles.cli import EXAMPLES
from sim_vehicles.config import FleetConfig, VehicleConfig, fleet_config
from sim_vehicles.fleet import Fleet
from sim_vehicles.truth import TruthWriter
from sim_vehicles.vehicle import Vehicle

SEPARATION_M = 20.0
MAX_BYTES = 65536
PREPARED = {
    "FS_GCS_ENABL": 1.0,
    "FS_LONG_ACTN": 1.0,
    "FS_LONG_TIMEOUT": 300.0,
    "FS_GCS_ENABLE": 1.0,
    "FS_GCS_TIMEOUT": 120.0,
    "NAV_DLL_ACT": 2.0,
    "COM_DL_LOSS_T": 300.0,
}
"""Failsafes that a scenario's vehicles have on, as docs/real-autopilots.md asks: home when heartbeats stop.

Their timeouts are the longest that the families allow, so that a station may be stopped and started again meanwhile.
"""


def prepare(vehicle: Vehicle) -> None:
    """Switch a vehicle's failsafes on, unless its scenario gives parameters itself."""
    if not vehicle.config.set_up:
        vehicle.parameters.prepare(PREPARED)


@click.command(epilog=EXAMPLES)
@click.argument("scenario", type=click.Path(path_type=Path), required=False)
@click.option("--count", type=WholeNumber(1, MAX_SYSTEM_ID), help="Without a scenario: how many vehicles.")
@click.option("--base-port", type=WholeNumber(1, MAX_PORT), help="Port of vehicle 1.  [default: 14550]")
@click.option("--one-port", is_flag=True, help="Every vehicle sends to the base port.")
@click.option("--set", "overrides", multiple=True, metavar="KEY=VALUE", help="Override a key of the scenario.")
@click.option(
    "--plugin",
    "plugins",
    multiple=True,
    type=click.Path(),
    metavar="FILE.py",
    help="What the scenario's extensions need.",
)
@click.option(
    "--vehicles", "chosen", metavar="IDS", help="Of the scenario's vehicles only these: 1,2; others fly elsewhere."
)
@click.option(
    "--endpoint",
    "ends",
    multiple=True,
    metavar="ID=ENDPOINT",
    help="A vehicle's own end, where it isn't the scenario's other one; all=ENDPOINT: everyone's. Repeatable; "
    "twice for one: two links.",
)
@click.option("--ready", "ready_s", type=SECONDS, metavar="SECONDS", help="From boot until armable.  [default: 3]")
@click.option("--speedup", type=Number(0.01, 1000), default=1.0, help="Times faster than real time.")
@click.option("--until", "until_s", type=SECONDS, metavar="SECONDS", help="End after this time.")
@click.option("--quiet", is_flag=True, help="Say nothing but errors.")
@click.option("--clock-origin", "clock_origin_ns", type=int, hidden=True)
@click.option("--truth", type=click.Path(path_type=Path), hidden=True)
@click.option("--truth-at-once", "at_once", is_flag=True, hidden=True)
@click.option("--with-parent", "parent_pid", type=int, hidden=True)
def fly(scenario: Path | None, overrides: tuple[str, ...], ready_s: float | None, quiet: bool, **options: Any) -> None:
    """Fly the emulated vehicles of SCENARIO, or --count of them, until Ctrl-C (exit status 130).

    SIGTERM and the closing of its terminal end it too (0), the latter not under nohup.
    """
    count, base_port, one_port = (options.pop(name) for name in ("count", "base_port", "one_port"))
    chosen: str | None = options.pop("chosen")
    plugins: tuple[str, ...] = options.pop("plugins")
    ends: tuple[str, ...] = options.pop("ends")
    if scenario is None and (overrides or chosen):
        fail(f"found {'--set' if overrides else '--vehicles'} without a scenario; allowed: with one")
    if scenario is not None and (count or base_port or one_port):
        fail("found a scenario beside --count, --base-port or --one-port; allowed: one of them")
    plain = _plain(count or 1, base_port or BASE_PORT, one_port=one_port)
    try:
        config = plain if scenario is None else fleet_config(load_scenario(scenario, overrides, plugins=plugins))
    except ScenarioError as error:
        fail(str(error))
    if chosen is not None:
        config = replace(config, vehicles=_chosen(config.vehicles, chosen))
    config = replace(config, vehicles=_ended(config.vehicles, ends))
    if ready_s is not None:
        config = replace(config, ready_s=ready_s)

    try:
        prepared = scenario is not None and options["parent_pid"] is None  # not those of `run`, which checks none
        sys.exit(_flown(config, quiet=quiet, prepared=prepared, **options))
    except (PortError, OSError, ExtensionError) as error:
        fail(str(error), Status.COULD_NOT_GO_ON)


def _flown(config: FleetConfig, truth: Path | None, quiet: bool, prepared: bool, **given: Any) -> Status:
    """Fly until a signal, the end of the time, or the end of the parent process; `truth`: file for the ground truth.

    `prepared`: whether the vehicles' failsafes are on.

    With a given clock origin (instant 0 on the machine's monotonic clock) instants are those of the parent process.
    """
    clock, signals = RealClock(given["speedup"], given["clock_origin_ns"]), list[int]()
    until_s, parent_pid = given["until_s"], given["parent_pid"]
    for number in (signal.SIGINT, signal.SIGTERM, signal.SIGHUP):
        if number != signal.SIGHUP or signal.getsignal(number) != signal.SIG_IGN:  # nohup ignores it
            signal.signal(number, lambda number, _frame: signals.append(number))
    terminal = Terminal() if parent_pid is None else None
    recording = TruthWriter(truth, len(config.vehicles), at_once=given["at_once"]) if truth else None
    with recording or nullcontext():
        begun = clock.now()
        vehicles = tuple(_resolved(each) for each in config.vehicles)
        fleet = Fleet(replace(config, vehicles=vehicles, utc_at_0_us=clock.utc_at_0_us), begun, recording)
        for vehicle in fleet.vehicles if prepared else ():
            prepare(vehicle)

        orders = None if parent_pid is None else ParentsOrders(fleet.environment)

        extensions = ExtensionWatch(fleet, to_parent=parent_pid is not None)

        def over() -> bool:
            late = until_s is not None and clock.now() - begun > until_s * NANOSECONDS
            closed = terminal is not None and terminal.closed
            if orders is not None:
                orders.poll()
            return bool(signals) or late or closed or extensions.over() or parent_pid not in (None, os.getppid())

        with Driver(fleet, clock) as driver:
            if not quiet:
                _greet("\n".join(map(_line, config.vehicles)))
            elif parent_pid is not None:
                _greet("ready")
            driver.run(over)
    if extensions.over():
        fail(str(fleet.failure), Status.COULD_NOT_GO_ON)
    return Status.INTERRUPTED if signals and signals[-1] == signal.SIGINT else Status.FINE


def _resolved(vehicle: VehicleConfig) -> VehicleConfig:
    """Return a vehicle whose endpoints have IP addresses in place of names."""
    return _with_ends(vehicle, [resolved(each) for each in vehicle.endpoints])


def _with_ends(vehicle: VehicleConfig, ends: list[Endpoint]) -> VehicleConfig:
    return replace(vehicle, endpoint=ends[0], further_endpoints=tuple(ends[1:]))


class ExtensionWatch:
    """Reports what failed of the fleet's extensions."""

    def __init__(self, fleet: Fleet, *, to_parent: bool) -> None:
        """Report it to the parent process, which ends the flight in order; without one the vehicles end."""
        self._fleet, self._to_parent, self._reported = fleet, to_parent, False

    def over(self) -> bool:
        """Return whether the vehicles end for it."""
        failure = self._fleet.failure
        if failure is None:
            return False
        if self._to_parent and not self._reported:
            self._reported = True
            _greet(failure)
        return not self._to_parent


class ParentsOrders:
    """Faults and disturbances from the parent process, lines of JSON on standard input."""

    def __init__(self, environment: Environment) -> None:
        """Pass them on to `environment`."""
        self._environment, self._read, self._open = environment, b"", sys.stdin is not None
        if self._open:
            os.set_blocking(sys.stdin.fileno(), False)

    def poll(self) -> None:
        """Take what has arrived."""
        while self._open:
            try:
                read = os.read(sys.stdin.fileno(), MAX_BYTES)
            except BlockingIOError:
                break
            self._open, self._read = bool(read), self._read + read
        *lines, self._read = self._read.split(b"\n")
        for line in lines:
            self._take(json.loads(line))

    def _take(self, order: dict[str, Any]) -> None:
        hit, zero = frozenset(VehicleId(*each) for each in order["vehicles"]), Instant(order["zero"])
        if "fault" in order:
            self._environment.strike(Fault(**order["fault"]), hit, zero)
        else:
            keys: Disturbance = TypeAdapter[Disturbance](Disturbance).validate_python(order["disturbance"])
            self._environment.disturb(keys, hit, zero)


class Terminal:
    """The terminal as standard input, if there is one; `nohup` and services have none."""

    def __init__(self) -> None:
        """Watch it, unless SIGHUP is ignored."""
        self._poll: select.poll | None = None
        if sys.stdin is not None and sys.stdin.isatty() and signal.getsignal(signal.SIGHUP) != signal.SIG_IGN:
            self._poll = select.poll()
            self._poll.register(sys.stdin.fileno(), 0)  # hang-ups are always reported

    @property
    def closed(self) -> bool:
        """Whether it has been closed; some shells then send no SIGHUP to what they started in the background."""
        return self._poll is not None and bool(self._poll.poll(0))


def _greet(text: str) -> None:
    try:
        click.echo(text)
    except BrokenPipeError:  # the reader has gone; the vehicles fly on for others
        drop(sys.__stdout__)


def _chosen(vehicles: tuple[VehicleConfig, ...], ids: str) -> tuple[VehicleConfig, ...]:
    """Return those vehicles of a scenario that a list like "1,2:7" names."""
    names = [name.strip() for name in ids.split(",")]
    known = [str(each.identity) for each in vehicles]
    for name in names:
        if name not in known:
            fail(f"--vehicles: found '{name}'; allowed: the scenario's vehicles, {', '.join(known)}")
    return tuple(each for each in vehicles if str(each.identity) in names)


def _ended(vehicles: tuple[VehicleConfig, ...], ends: tuple[str, ...]) -> tuple[VehicleConfig, ...]:
    """Return the vehicles with their own ends of links as texts like "2=serial:/dev/ttyUSB0:57600" give them.

    Several for one vehicle are its links, in their order.
    """
    given_ends = dict[str, list[Endpoint]]()
    found, known = {str(each.identity): each for each in vehicles}, ", ".join(str(each.identity) for each in vehicles)
    for text in ends:
        name, given, end = text.partition("=")
        if not given or (name not in found and name != "all"):
            fail(f"--endpoint: found '{text}'; allowed: ID=ENDPOINT with an ID of {known}, or all=ENDPOINT")
        try:
            endpoint = parse_endpoint(end)
        except EndpointError as error:
            fail(f"--endpoint: {error}")
        given_ends.setdefault(name, []).append(endpoint)
    for name, each in found.items():
        own = given_ends.get(name) or given_ends.get("all")
        if own:
            found[name] = _with_ends(each, own)
    return tuple(found.values())


def _plain(count: int, base_port: int, *, one_port: bool) -> FleetConfig:
    """Return the configuration of vehicles in a row on the ground, heading north."""
    last = base_port if one_port else base_port + count - 1
    if last > MAX_PORT:
        fail(f"found ports up to {last}; allowed: up to {MAX_PORT}")
    vehicles = tuple(
        VehicleConfig(
            VehicleId(1, 1 + i),
            Endpoint("udpout", Address(LOOPBACK, base_port if one_port else base_port + i)),
            StartState(0.0, i * SEPARATION_M),
        )
        for i in range(count)
    )
    return FleetConfig(Origin().geodetic, vehicles)


def _line(vehicle: VehicleConfig) -> str:
    return f"vehicle {vehicle.identity} {' and '.join(_end(each) for each in vehicle.endpoints)}"


def _end(endpoint: Endpoint) -> str:
    if endpoint.kind == "serial":
        return f"is at {endpoint}"
    return f"{'listens at' if endpoint.peer is None else 'sends to'} {endpoint.address}"
