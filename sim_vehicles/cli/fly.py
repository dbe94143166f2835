"""`sim-vehicles fly`, or `sim-vehicles` alone: runs a fleet over UDP under the real clock."""

from __future__ import annotations

import math
import os
import signal
import sys
from collections.abc import Callable
from contextlib import nullcontext
from dataclasses import dataclass, replace
from pathlib import Path
from types import FrameType
from typing import Any

import click

from airlink.cli.commands import SECONDS, Number, WholeNumber
from airlink.cli.process import Status, fail
from airlink.clock import NANOSECONDS, RealClock
from airlink.endpoint import LOOPBACK, MAX_PORT, Address, Endpoint, VehicleId
from airlink.errors import PortError
from airlink.udp import UdpDriver
from formation_scenario import ScenarioError, load_scenario
from formation_scenario.fields import MAX_SYSTEM_ID
from formation_scenario.model import Origin
from formation_scenario.vehicles import BASE_PORT
from sim_vehicles.cli import EXAMPLES
from sim_vehicles.config import FleetConfig, Start, VehicleConfig, fleet_config
from sim_vehicles.fleet import Fleet
from sim_vehicles.truth import TruthWriter

APART_M = 20.0
ORIGIN = Origin()


@dataclass(frozen=True)
class RunnerOptions:
    """How a fleet is run."""

    speedup: float = 1.0
    until_s: float | None = None
    clock_origin_ns: int | None = None
    """Instant 0 on the machine's monotonic clock, to share instants with another process."""
    truth: Path | None = None
    truth_rate_hz: float = 25.0
    parent_pid: int | None = None
    """The process that started us: we end when it does."""


def run(config: FleetConfig, options: RunnerOptions, started: Callable[[Fleet], None]) -> int:
    """Fly until told to stop; return the exit status. `started` is called once the sockets are open.

    Raises:
        PortError: a vehicle's own port can't be opened.
    """
    clock = RealClock(options.speedup, options.clock_origin_ns)
    recording = TruthWriter(options.truth, len(config.vehicles), options.truth_rate_hz) if options.truth else None
    with recording or nullcontext():
        begun = clock.now()
        fleet = Fleet(replace(config, utc_at_0_us=clock.utc_at_0_us), begun, recording)
        stop = _Stop()

        def over() -> bool:
            late = options.until_s is not None and clock.now() - begun > options.until_s * NANOSECONDS
            return stop.signal is not None or late or options.parent_pid not in (None, os.getppid())

        with UdpDriver(fleet, clock) as driver:
            started(fleet)
            driver.run(over)
    return Status.INTERRUPTED if stop.signal == signal.SIGINT else Status.FINE


class _Stop:
    """The signal that asked us to end."""

    def __init__(self) -> None:
        self.signal: int | None = None
        for number in (signal.SIGINT, signal.SIGTERM):
            signal.signal(number, self._note)

    def _note(self, number: int, _frame: FrameType | None) -> None:
        self.signal = number


@click.command(epilog=EXAMPLES)
@click.argument("scenario", type=click.Path(path_type=Path), required=False)
@click.option("--count", type=WholeNumber(1, MAX_SYSTEM_ID), help="Without a scenario: how many vehicles.")
@click.option(
    "--base-port",
    type=WholeNumber(1, MAX_PORT),
    help="Port of vehicle 1.  [default: 14550]",
)
@click.option("--one-port", is_flag=True, help="Every vehicle sends to the base port.")
@click.option("--set", "overrides", multiple=True, metavar="KEY=VALUE", help="Override a key of the scenario.")
@click.option("--ready", "ready_s", type=SECONDS, metavar="SECONDS", help="From boot until armable.  [default: 3]")
@click.option("--speedup", type=Number(0.01, 1000), default=1.0, help="Times faster than real time.")
@click.option("--until", "until_s", type=SECONDS, metavar="SECONDS", help="End after this time.")
@click.option("--quiet", is_flag=True, help="Say nothing but errors.")
@click.option("--clock-origin", "clock_origin_ns", type=int, hidden=True)
@click.option("--truth", type=click.Path(path_type=Path), hidden=True)
@click.option("--truth-rate", "truth_rate_hz", type=Number(0.01, 50), default=25.0, hidden=True)
@click.option("--with-parent", "parent_pid", type=int, hidden=True)
def fly(
    scenario: Path | None,
    count: int | None,
    base_port: int | None,
    one_port: bool,
    overrides: tuple[str, ...],
    ready_s: float | None,
    quiet: bool,
    **options: Any,
) -> None:
    """Fly the emulated vehicles of SCENARIO, or --count of them, until Ctrl-C."""
    if scenario is None and overrides:
        fail("found --set without a scenario; allowed: with one")
    if scenario is not None and (count or base_port or one_port):
        fail("found a scenario beside --count, --base-port or --one-port; allowed: one of them")
    plain = _plain(count or 1, base_port or BASE_PORT, one_port=one_port)
    config = plain if scenario is None else _of(scenario, overrides)
    if ready_s is not None:
        config = replace(config, ready_s=ready_s)

    def started(fleet: Fleet) -> None:
        if not quiet:
            click.echo("\n".join(_line(vehicle) for vehicle in fleet.config.vehicles))

    try:
        sys.exit(run(config, RunnerOptions(**options), started))
    except (PortError, OSError) as error:
        fail(str(error), Status.COULD_NOT_GO_ON)


def _of(scenario: Path, overrides: tuple[str, ...]) -> FleetConfig:
    try:
        planned = load_scenario(scenario, overrides)
    except ScenarioError as error:
        fail(str(error))
    return fleet_config(planned)


def _plain(count: int, base_port: int, *, one_port: bool) -> FleetConfig:
    """Return vehicles in a row on the ground, heading north."""
    last = base_port if one_port else base_port + count - 1
    if last > MAX_PORT:
        fail(f"found ports up to {last}; allowed: up to {MAX_PORT}")
    vehicles = tuple(
        VehicleConfig(
            VehicleId(1, 1 + i),
            Endpoint("udpout", Address(LOOPBACK, base_port if one_port else base_port + i)),
            Start(0.0, i * APART_M),
        )
        for i in range(count)
    )
    return FleetConfig(math.radians(ORIGIN.lat_deg), math.radians(ORIGIN.lon_deg), ORIGIN.alt_m, vehicles)


def _line(vehicle: VehicleConfig) -> str:
    what = "sends to" if vehicle.endpoint.kind == "udpout" else "listens at"
    return f"vehicle {vehicle.identity} {what} {vehicle.endpoint.address}"
