"""Reads an unfinished record in order to resume its flight."""

from __future__ import annotations

import json
import math
from collections.abc import Mapping, Sequence
from itertools import pairwise
from pathlib import Path
from typing import Any

import numpy as np

from airlink.clock import NANOSECONDS, Instant, after, nanoseconds, seconds_between
from airlink.endpoint import VehicleId
from flight_model.arrays import Array
from formation_scenario import Scenario
from formation_scenario.orders import Order, read_order
from formation_scenario.slot_assignment import Arrangement, first_arrangement, ids_by_index
from gcs_formation.errors import RecordError
from gcs_formation.fleet.membership import PARTED
from gcs_formation.guidance.parts import AlongPath
from gcs_formation.mission.past_flight import LEFT, TAKEN, TO_PILOT, PastFlight, RecordedVehicle
from gcs_formation.phases import Cause, Phase
from gcs_formation.record.json_shape import mismatch
from gcs_formation.record.run_directory import (
    EVENTS,
    FLUSH_S,
    GOES_ON,
    PORT,
    RECORDING,
    SCENARIO,
    SPOOL,
    SUMMARY,
    event_shape,
)
from gcs_formation.record.timeseries import PHASES, SLOT, Spool
from gcs_formation.vehicle.parameter_setting import Change

ACCEPTED = ": accepted"
GAVE_UP = (Cause.FAILURE, Cause.NOT_BEGUN, Cause.GIVEN_UP)
"""Causes of an end that isn't the flight's own."""
EVERY_S = 1.0
"""Interval between positions used to follow the leader's path."""
GAP_S, REACH = 3.0, 2.0
"""A longer gap means an interruption, in which the leader flew at most this multiple of the planned distance."""
AT_END = (Phase.ENDING, Phase.LOITERING, Phase.DONE, Phase.FAILED)
Events = Sequence[Mapping[str, Any]]


def epoch_us(directory: Path) -> int:
    """Return when the clock of an unfinished record began, microseconds since 1970.

    Raises:
        RecordError: it isn't the directory of an unfinished run, or its run recorded nothing.
    """
    if not (directory / SCENARIO).is_file():
        raise RecordError(f"found no {SCENARIO} in {directory}; allowed: the directory of an unfinished run")
    if (directory / SUMMARY).is_file():
        found = f"found {SUMMARY} in {directory}: that run has come to its end"
        raise RecordError(f"{found}; allowed: the directory of an unfinished run")
    begins = next((event for event in recorded_events(directory)[0] if event.get("kind") == RECORDING), None)
    if begins is None or not isinstance(begins.get("epoch_us"), int):
        raise RecordError(f"found no beginning in {directory / EVENTS}: nothing was recorded that can be resumed")
    return int(begins["epoch_us"])


def from_ports(directory: Path) -> dict[str, int]:
    """Return the local ports that the flight used for each `udpout` endpoint: a PX4 answers no other port."""
    those = (event for event in recorded_events(directory)[0] if event.get("kind") == PORT)
    return {str(event["endpoint"]): int(event["port"]) for event in those}


def recorded_speedup(directory: Path) -> float:
    """Return how many times faster than real time an unfinished record ran at its beginning."""
    events = recorded_events(directory)[0]
    known = (event["speedup"] for event in events if event["kind"] == RECORDING and "speedup" in event)
    return float(next(known, 1.0))


def set_before(directory: Path) -> list[tuple[str, Change]]:
    """Return the parameters that an unfinished record's flight has set and not restored, and each one's vehicle."""
    found = dict[tuple[str, str], Change]()
    for event in recorded_events(directory)[0]:
        key = str(event.get("vehicle")), str(event.get("name"))
        if event.get("kind") == "parameters" and event.get("restored"):
            found.pop(key, None)
        elif event.get("kind") == "parameters" and "param_type" in event:
            change = Change(key[1], int(event["param_type"]), float(event["before"]), float(event["after"]))
            found.setdefault(key, change)
    return [(whose, change) for (whose, _), change in found.items()]


def read_past(directory: Path, scenario: Scenario, now: Instant, *, take: bool) -> PastFlight:
    """Return the state of an unfinished record's flight at `now`, or at the record's end if that is later.

    Raises:
        RecordError: the record can't be read, or no vehicle had been received.
    """
    recorded, _ = recorded_events(directory)
    try:
        rows = Spool(directory / SPOOL).read()
    except (OSError, ValueError) as error:
        raise RecordError(f"cannot read {directory / SPOOL}: {error}") from error
    now = _after_record(now, recorded, rows["t_s"])
    events, gaps_s = without_vain_attempts(recorded)
    for begun_s, ended_s in gaps_s:
        kept = (rows["t_s"] < begun_s) | (rows["t_s"] >= ended_s)
        rows = {name: values[kept] for name, values in rows.items()}
    silent_s = seconds_between(Instant(nanoseconds(_end_s(events, rows["t_s"]))), now) + FLUSH_S
    if not rows["t_s"].size:
        return _before_take_off(directory, scenario, events, now, silent_s, take=take)
    last = {name: values[rows["t_s"] == rows["t_s"][-1]] for name, values in rows.items()}
    mission_s, flying = float(last["mission_time_s"][0]), _began(events)
    leading = _identity(last, int(np.argmax(last["leads"] > 0))) if (last["leads"] > 0).any() else None
    arrangement, speed_mps, heading_rad = formation_of(scenario, events, mission_s)
    order = ids_by_index(scenario)
    return PastFlight(
        at=now,
        vehicles={each.vehicle_id: _known(each.vehicle_id, last, events) for each in scenario.vehicles},
        mission_s=mission_s,
        path_began=flying,
        distance_m=_distance_m(scenario, rows),
        speed_mps=speed_mps,
        heading_rad=heading_rad,
        arrangement=arrangement._replace(leader=order.index(leading)),
        slots_m=_slots_m(last, order),
        near=() if leading is None else nearest_to(last, leading),
        ending=_was_ending(events, Phase(PHASES[int(last["phase"][0])])),
        take=take,
        silent_s=silent_s,
    )


def without_vain_attempts(events: Events) -> tuple[Events, list[tuple[float, float]]]:
    """Return the events without those of attempts to resume in which no vehicle was taken over, and when these were, s.

    Such an attempt has changed nothing: whatever comes after it goes on from the state before it.
    """
    begins = [n for n, event in enumerate(events) if event["kind"] == RECORDING and event["text"] == GOES_ON]
    kept, gaps_s = list(events[: begins[0] if begins else None]), list[tuple[float, float]]()
    for begun, ended in pairwise([*begins, len(events)]):
        attempt = events[begun:ended]
        if any(event["kind"] == "takeover" and event["text"].startswith(TAKEN) for event in attempt):
            kept += attempt
        else:
            until_s = float(events[ended]["t_s"]) if ended < len(events) else math.inf
            gaps_s.append((float(attempt[0]["t_s"]), until_s))
    return tuple(kept), gaps_s


def _was_ending(events: Events, recorded: Phase) -> bool:
    """Return whether a flight was at its end, in which vehicles are to circle; `recorded`: the last tick's phase.

    A flight that couldn't go on isn't: it is resumed to go on.
    """
    phases = [event for event in events if event["kind"] == "phase"]
    ends = list[Mapping[str, Any]]()
    for event in reversed(phases):
        if event["text"] not in [phase.value for phase in AT_END]:
            break
        ends.append(event)
    if not ends:
        return recorded in AT_END
    return ends[-1].get("cause") not in [cause.value for cause in GAVE_UP]


def _after_record(now: Instant, events: Events, ticks_s: Array) -> Instant:
    """Return `now`, or the latest possible end of the record if that is later.

    A machine's clock without a battery falls behind when its power fails.
    """
    last = Instant(nanoseconds(_end_s(events, ticks_s)))
    return now if now > last else after(last, FLUSH_S)


def _end_s(events: Events, ticks_s: Array) -> float:
    """Return the time of the last event or tick, s."""
    return max((*(float(event["t_s"]) for event in events if "t_s" in event), *ticks_s[-1:].tolist()), default=0.0)


def _before_take_off(
    directory: Path, scenario: Scenario, events: Events, now: Instant, silent_s: float, *, take: bool
) -> PastFlight:
    """Return the state of a flight without recorded ticks: at most the last second before its end isn't on disk."""
    order = [identity for identity in ids_by_index(scenario) if identity is not None]
    known = {identity: RecordedVehicle(_last(events, identity, "mode"), parted=False, flew=False) for identity in order}
    if not any(each.mode for each in known.values()):
        raise RecordError(f"found no flight in {directory}: no vehicle had been heard; allowed: fly it from its start")
    arrangement = first_arrangement(scenario)
    return PastFlight(
        at=now,
        vehicles=known,
        mission_s=math.nan,
        path_began=None,
        distance_m=0.0,
        speed_mps=scenario.path.begin_mps,
        heading_rad=None,
        arrangement=arrangement,
        slots_m=np.zeros((1 + len(scenario.followers), 3)),
        near=tuple(order) if scenario.leader else (),
        ending=_was_ending(events, Phase.CONNECTING),
        take=take,
        silent_s=silent_s,
    )


def _last(events: Events, identity: VehicleId, kind: str) -> str | None:
    """Return the text of the last event of a kind about a vehicle."""
    own = (event for event in reversed(events) if event["kind"] == kind and event.get("vehicle") == str(identity))
    return next((str(event["text"]) for event in own), None)


def recorded_events(directory: Path) -> tuple[tuple[Mapping[str, Any], ...], bool]:
    """Return the events of an unfinished run, and whether the last one was cut off."""
    path = directory / EVENTS
    parsed = [_parsed(line) for line in path.read_bytes().splitlines()] if path.is_file() else []
    return tuple(event for event in parsed if event is not None), parsed[-1:] == [None]


def _parsed(line: bytes) -> Mapping[str, Any] | None:
    try:
        event: Any = json.loads(line)
    except ValueError:
        return None
    return None if mismatch(event, event_shape(event), EVENTS) is not None else event


def _began(events: Events) -> Instant | None:
    """Return when the leader passed the start of the path."""
    begun = (event for event in events if event["kind"] == "phase" and event["text"] == Phase.FLYING.value)
    at_s = next((float(event["t_s"]) for event in begun), None)
    return None if at_s is None else Instant(round(at_s * NANOSECONDS))


def _known(identity: VehicleId, last: Mapping[str, Any], events: Events) -> RecordedVehicle:
    row = (last["network"] == identity.network) & (last["vehicle"] == identity.system)
    return RecordedVehicle(
        mode=_last(events, identity, "mode"),
        parted=_is_parted(events, identity),
        flew=bool((last["airborne"][row] > 0).any()),
    )


def _is_parted(events: Events, identity: VehicleId) -> bool:
    """Return whether a vehicle had left the formation, or was left to its pilot, when that was last said."""
    kinds = ("member", "takeover", "abandoned")
    own = (event for event in reversed(events) if event["kind"] in kinds and event.get("vehicle") == str(identity))
    text = next((str(event["text"]) for event in own), "")
    return text.startswith((PARTED, LEFT)) or text.endswith(TO_PILOT)


def formation_of(scenario: Scenario, events: Events, mission_s: float) -> tuple[Arrangement, float, float | None]:
    """Return arrangement, speed and hover heading after the changes and accepted orders so far."""
    begun = _began(events)
    zero_s = math.inf if begun is None else begun / NANOSECONDS
    planned = [(change.at_s, Order("", change)) for change in scenario.formation.changes if change.at_s <= mission_s]
    given = [
        (float(event["t_s"]) - zero_s, read_order(str(event["text"]).removesuffix(ACCEPTED)))
        for event in events
        if event["kind"] == "order" and event.get("accepted")
    ]
    arrangement, speed_mps, heading_rad = first_arrangement(scenario), scenario.path.begin_mps, None
    for _, order in sorted([*planned, *given], key=lambda each: each[0]):
        if order.change is not None:
            arrangement = arrangement.changed(order.change, scenario)
        speed_mps = speed_mps if order.speed_mps is None else order.speed_mps
        heading_rad = heading_rad if order.heading_rad is None else order.heading_rad
    return arrangement, speed_mps, heading_rad if speed_mps == 0.0 else None


def _distance_m(scenario: Scenario, rows: Mapping[str, Any]) -> float:
    """Return the leader's distance along the path, by following its track from the path's start."""
    follower, last_s = AlongPath(scenario.leader_path), math.inf
    leads = (rows["leads"] > 0) & (rows["phase"] == PHASES.index("flying")) & np.isfinite(rows["north_m"])
    positions = zip(*(rows[name][leads].tolist() for name in ("t_s", "north_m", "east_m")), strict=True)
    for t_s, north_m, east_m in positions:
        unseen_s = t_s - last_s
        if unseen_s > GAP_S:  # an earlier interruption
            follower.search(north_m, east_m, REACH * scenario.path.begin_mps * unseen_s)
        elif not 0.0 <= unseen_s < EVERY_S:
            follower.project(north_m, east_m)
        else:
            continue
        last_s = t_s
    return follower.distance_m


def _slots_m(last: Mapping[str, Any], order: Sequence[VehicleId | None]) -> Array:
    """Return the slots (C, 3) of all columns, 0 for the leader; `order` names the columns' vehicles."""
    own = {_identity(last, row): row for row in range(len(last["t_s"]))}
    table = np.nan_to_num(np.stack([last[name] for name in SLOT], axis=1))
    return np.array([np.zeros(3) if each is None else table[own[each]] for each in order])


def nearest_to(last: Mapping[str, Any], leading: VehicleId) -> tuple[VehicleId, ...]:
    """Return the recorded vehicles, the leader first, then by their distance from it to a metre."""
    positions = np.stack([last[name] for name in ("north_m", "east_m", "height_m")], axis=1)
    each = [_identity(last, row) for row in range(len(positions))]
    away_m: Array = np.linalg.norm(positions - positions[each.index(leading)], axis=1)
    metres: Array = np.where(np.isfinite(away_m), np.round(away_m), np.inf)
    order: list[int] = np.argsort(metres, kind="stable").tolist()
    return tuple(each[row] for row in order)


def _identity(last: Mapping[str, Any], row: int) -> VehicleId:
    return VehicleId(int(last["network"][row]), int(last["vehicle"][row]))
