"""Invariants of every flight, whatever happens to vehicles and links, checked on the flight's own record."""

from __future__ import annotations

import json
import math
from collections.abc import Iterator, Mapping
from dataclasses import dataclass
from itertools import combinations
from pathlib import Path
from typing import Any

import numpy as np

from airlink import mavlink as m
from airlink.messages.command import CommandInt
from airlink.stream_parser import StreamParser
from flight_model.arrays import Array, Mask
from formation_scenario import Scenario
from formation_scenario import Vehicle as PlannedVehicle
from formation_scenario.fields import distinct_texts
from gcs_formation.link.frame_loss import STALE_AFTER_S
from gcs_formation.record import timeseries
from gcs_formation.record.expectations import crash_planned_s
from gcs_formation.record.parquet import read_parquet
from gcs_formation.record.run_directory import EVENTS, SUMMARY, TIMESERIES, TLOG
from gcs_formation.record.timeseries import ERROR, TRUTH, flying
from gcs_formation.record.tlog import read_tlog

REGAINED_M = 1.0
REGAINED_FOR_S = 10.0
"""At the end, every follower must have been within this distance of its slot for this long."""
NEAR_END_M = 30.0
"""Distance from the path's end within which the leader counts as at the end."""
ROUNDING = 1e-3
"""Tolerance for single precision on the wire."""


@dataclass(frozen=True)
class FlightRecord:
    """The record of a flight."""

    scenario: Scenario
    summary: Mapping[str, Any]
    events: tuple[Mapping[str, Any], ...]
    columns: Mapping[str, Array]
    """The time series."""
    sent: tuple[CommandInt, ...]
    """Guided commands of the ground station, as read back from the log."""
    frames: int
    """Number of frames in the log."""

    def rows(self, vehicle: PlannedVehicle) -> Mapping[str, Array]:
        """Return a vehicle's time series."""
        mine = (self.columns["network"] == vehicle.network) & (self.columns["vehicle"] == vehicle.id)
        return {name: values[mine] for name, values in self.columns.items()}

    @property
    def flying(self) -> Mask:
        """Rows between the path's beginning and the flight's end."""
        return flying(self.columns)

    @property
    def ends_s(self) -> float:
        """Mission time of the flight's end; minus infinity if the path was never begun."""
        return float(self.columns["mission_time_s"][self.flying].max(initial=-np.inf))

    @property
    def at_path_end(self) -> bool:
        """Whether the leader is then at the end of the path: with a tailwind it gets there before the time is over."""
        last = self.flying & (self.columns["leads"] > 0) & (self.columns["mission_time_s"] >= self.ends_s)
        distance_m = [
            self.columns[name][last] - self.scenario.path.waypoints_m[-1][i] for i, name in enumerate(TRUTH[:2])
        ]
        return bool((np.linalg.norm(distance_m, axis=0) < NEAR_END_M).any())

    def crashes(self, vehicle: PlannedVehicle) -> bool:
        """Return whether the scenario's faults crash a vehicle."""
        return math.isfinite(crash_planned_s(self.scenario, vehicle.vehicle_id))


def read_record(directory: Path, scenario: Scenario) -> FlightRecord:
    """Read the record in a run directory."""
    parser, raws = StreamParser(), [raw for _, raw in read_tlog(directory / TLOG)]
    messages = (frame.message for raw in raws for frame in parser.feed(raw))
    lines = (directory / EVENTS).read_text(encoding="utf-8").splitlines()
    return FlightRecord(
        scenario=scenario,
        summary=json.loads((directory / SUMMARY).read_text(encoding="utf-8")),
        events=tuple(json.loads(line) for line in lines),
        columns=read_parquet(directory / TIMESERIES),
        sent=tuple(each for each in messages if isinstance(each, CommandInt)),
        frames=len(raws),
    )


def broken(flown: FlightRecord) -> list[str]:
    """Return the invariants that were broken, in words with their figures."""
    return [text for invariant in CHECKS for text in invariant(flown)]


def separation(flown: FlightRecord) -> Iterator[str]:
    """No two flying vehicles come closer than `safety.separation_m`, from the first take-off to the end."""
    min_m = flown.scenario.safety.separation_m
    for one, other in combinations(flown.scenario.vehicles, 2):
        ours, theirs = flown.rows(one), flown.rows(other)
        distance_m = np.linalg.norm([ours[name] - theirs[name] for name in TRUTH[:3]], axis=0)
        flying = (ours[timeseries.AIRBORNE] > 0) & (theirs[timeseries.AIRBORNE] > 0)
        near = np.where(flying, distance_m, np.inf)
        if near.min(initial=np.inf) < min_m:
            worst = int(near.argmin())
            found, allowed = distinct_texts(float(near[worst]), min_m)
            flown_s, phase = ours["mission_time_s"][worst], timeseries.PHASES[int(ours["phase"][worst])]
            when = "before the path" if np.isnan(flown_s) else f"at {flown_s:.1f} s"
            yield (
                f"separation: vehicles {one.vehicle_id} and {other.vehicle_id} were {found} m apart {when} ({phase}); "
                f"allowed: {allowed} m or more"
            )


def envelope(flown: FlightRecord) -> Iterator[str]:
    """Every commanded speed is within the vehicle's limits; every heading and height is a number."""
    models = {vehicle.id: vehicle.model for vehicle in flown.scenario.vehicles}
    for command in flown.sent:
        system = command.target_system
        if not all(map(np.isfinite, (command.param1, command.param2, command.param3, command.z))):
            yield f"envelope: vehicle {system} was sent {command}, which isn't finite"
        elif command.command == m.MAV_CMD_GUIDED_CHANGE_SPEED:
            low, high = models[system].speed_min_mps, models[system].speed_max_mps
            if not low - ROUNDING <= command.param2 <= high + ROUNDING:
                yield f"envelope: vehicle {system} was sent {command.param2:.3f} m/s; allowed: {low:g} to {high:g}"
        elif command.command == m.MAV_CMD_GUIDED_CHANGE_HEADING and not 0.0 <= command.param2 <= 360.0:
            yield f"envelope: vehicle {system} was sent heading {command.param2:.3f} degrees; allowed: 0 to 360"


def finite(flown: FlightRecord) -> Iterator[str]:
    """State and setpoint of every commanded vehicle are finite, and so is every true state."""
    for names, rows in (
        ((*timeseries.STATE, *timeseries.SETPOINT), flown.columns["active"]),
        (TRUTH, np.isfinite(flown.columns["t_s"])),
    ):
        for name in names:
            wrong = rows & ~np.isfinite(flown.columns[name])
            if wrong.any():
                first = int(wrong.argmax())
                where = f"vehicle {flown.columns['vehicle'][first]}, t = {flown.columns['t_s'][first]:.1f} s"
                yield f"finite: {name} isn't a number in {int(wrong.sum())} rows, first {where}"


def acknowledged(flown: FlightRecord) -> Iterator[str]:
    """The run came to its end, and every vehicle that still exists acknowledged that it loiters."""
    lost = {str(each.vehicle_id) for each in flown.scenario.vehicles if flown.crashes(each)}
    for event in flown.events:
        if event["kind"] == "failure" or (event["kind"] == "unacknowledged" and event.get("vehicle") not in lost):
            yield f"acknowledged: {event.get('vehicle', 'the run')}: {event['text']}"


def recorded(flown: FlightRecord) -> Iterator[str]:
    """The log has every counted frame; the time series has a row for each tick and vehicle, without gaps."""
    links, received = flown.summary["links"].values(), flown.summary["received"]
    taken, sent = (sum(link[count] for link in links) for count in ("frames_in", "frames_out"))
    if lost := received["frames"] - taken - received["frames_refused"]:
        yield f"recorded: {lost} frames more than were taken or refused came in"
    if flown.frames != received["frames"] + sent:
        yield f"recorded: the log has {flown.frames} frames; came in and went out: {received['frames'] + sent}"
    period_s = 1.0 / flown.scenario.law.rate_hz
    for vehicle in flown.scenario.vehicles:
        steps_s = np.diff(flown.rows(vehicle)["t_s"])
        if not np.allclose(steps_s, period_s, atol=1e-6):
            yield f"recorded: vehicle {vehicle.vehicle_id} has ticks {steps_s.max():.3f} s apart, not {period_s:g}"
    if flown.ends_s < flown.scenario.duration_s - 2 * period_s and not flown.at_path_end:
        yield f"recorded: the flight ends at {flown.ends_s:.1f} s of {flown.scenario.duration_s:g}"


def regained(flown: FlightRecord) -> Iterator[str]:
    """After a calm time at the end, every vehicle that doesn't lead is in its slot."""
    for vehicle in flown.scenario.vehicles:
        rows = flown.rows(vehicle)
        late = (rows["mission_time_s"] > flown.ends_s - REGAINED_FOR_S) & (rows["leads"] == 0)
        late &= flying(rows)
        if flown.crashes(vehicle) or not late.any() or _held_up(flown, rows):
            continue
        worst_m = max(float(np.abs(rows[name][late]).max()) for name in ERROR)
        if not worst_m < REGAINED_M:
            yield (
                f"regained: vehicle {vehicle.vehicle_id} was {worst_m:.2f} m from its slot in the last "
                f"{REGAINED_FOR_S:g} s; allowed: {REGAINED_M:g} m"
            )


def _held_up(flown: FlightRecord, rows: Mapping[str, Array]) -> bool:
    """Whether a message sent before the last link change is delayed, by seconds as in Pareto's tail, into the calm."""
    calm_from_s = max((change.at_s for change in flown.scenario.links.changes), default=0.0)
    there_and_back_s = 2 * rows[timeseries.INJECTED_MEAN]
    under_way = rows["mission_time_s"] + there_and_back_s > calm_from_s
    return bool((under_way & (rows["mission_time_s"] < calm_from_s) & (there_and_back_s > STALE_AFTER_S)).any())


CHECKS = (separation, envelope, finite, acknowledged, recorded, regained)
