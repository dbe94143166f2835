"""One page on a flight under way: `gcs-formation tell RUN_DIR status`."""

from __future__ import annotations

import math

import numpy as np

from airlink.clock import NANOSECONDS, Instant
from airlink.identity import VehicleId
from gcs_formation.app.columns import Group, table, wrapped
from gcs_formation.arrays import Array
from gcs_formation.link.connection import LinkState
from gcs_formation.membership import Member
from gcs_formation.station import Station
from gcs_formation.vehicle.vehicle import Vehicle

WIDTH = 80
SHORT = {
    Member.STARTING: "starting",
    Member.FLYING: "in formation",
    Member.PARTED: "its pilot's",
    Member.UNHEARD: "not heard",
    Member.HOLDING: "told to loiter",
    Member.RETURNING: "coming back",
}


def status_page(station: Station, now: Instant, width: int = WIDTH) -> str:
    """Return phase and time, and each vehicle's place, errors (slot minus vehicle, m), delays and margin in use."""
    return "\n".join([*wrapped(_headline(station, now), width), *table(_groups(station), width)])


def _headline(station: Station, now: Instant) -> str:
    flight, scenario = station.flight, station.scenario
    mission_s = flight.mission_time_s(now)
    since = "" if math.isnan(mission_s) else f", t = {mission_s:.1f} of {scenario.duration_s:g} s"
    failure = f"; {station.failure.text}" if station.failure else ""
    return f"{scenario.name}: {flight.phase.value}{since}, {now / NANOSECONDS:.1f} s after the start{failure}"


def _groups(station: Station) -> list[Group]:
    """Return the table's columns; errors and states stay longest."""
    vehicles, tick = station.vehicles, station.last_tick
    unknown = np.full(3, np.nan)
    errors = [unknown if tick is None else tick.error_m[station.column(each)] for each in vehicles]
    used = [station.margins.used[station.column(each)] for each in vehicles]
    state = [(_state(station, each, vehicle),) for each, vehicle in vehicles.items()]
    return [
        Group(
            ("vehicle", "x", "y", "z"), [(str(i), *_cells(own, 2)) for i, own in zip(vehicles, errors, strict=True)], 5
        ),
        Group(("one-way ms",), [_cells([v.clock.one_way_s * 1e3], 0) for v in vehicles.values()], 2),
        Group(("up", "down"), [_cells([1e3 * way_s for way_s in v.ways_s], 0) for v in vehicles.values()], 1),
        Group(("loss",), [(f"{vehicle.sequence.loss:.1%}",) for vehicle in vehicles.values()], 0),
        Group(("margin used",), [(f"{each:.0%}" if math.isfinite(each) else "–",) for each in used], 3),
        Group(("state",), state, 4),
    ]


def _state(station: Station, identity: VehicleId, vehicle: Vehicle) -> str:
    """Return what a vehicle does: its link if that isn't well, else its start-up, its lead, or its membership."""
    tick, link = station.last_tick, vehicle.connection.state
    if link is not LinkState.CONNECTED:
        return f"link {link.value}"
    if not vehicle.start_up.finished:
        return vehicle.start_up.doing
    leads = tick is not None and tick.leader == station.column(identity)
    return "leads" if leads and vehicle.member is Member.FLYING else SHORT[vehicle.member]


def _cells(values: Array | list[float], digits: int) -> tuple[str, ...]:
    return tuple(f"{value:.{digits}f}" if math.isfinite(value) else "–" for value in values)
