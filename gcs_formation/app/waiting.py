"""What a flight waits for before its path begins, in words: the assembly takes minutes."""

from __future__ import annotations

import math

from formation_scenario.slot_assignment import ids_by_index
from gcs_formation.phases import Phase
from gcs_formation.recorder import Tick
from gcs_formation.station import Station

MAX_NAMED = 4
BEFORE_PATH = (Phase.CONNECTING, Phase.ASSEMBLING)


def waits_for(station: Station) -> str:
    """Return what is waited for, and for how much longer as far as that is known; "" once the path has begun."""
    if station.flight.phase not in BEFORE_PATH:
        return ""
    doing = _starting(station)
    if station.flight.phase is Phase.CONNECTING or station.last_tick is None:
        return doing
    return "; ".join(filter(None, (doing, _far_from_slot(station, station.last_tick), _to_path(station))))


def _starting(station: Station) -> str:
    """Return who isn't ready yet, and what is done about it."""
    vehicles = [(each.identity, each.start_up) for each in station.vehicles.values()]
    found = dict[str, list[str]]()
    for identity, start_up in vehicles:
        if not (start_up.finished or start_up.left):
            found.setdefault(start_up.doing, []).append(str(identity))
    each = [
        f"vehicle {', '.join(who[:MAX_NAMED])}{' …' * (len(who) > MAX_NAMED)}: {what}" for what, who in found.items()
    ]
    return "; ".join(each)


def _far_from_slot(station: Station, tick: Tick) -> str:
    """Return which follower is farthest from its slot, if it is farther than `start.tolerance_m`."""
    identities, max_m, farthest = ids_by_index(station.scenario), station.scenario.start.tolerance_m, ""
    for index, identity in enumerate(identities):
        off_m = max((abs(error) for error in tick.error_of(index)), default=math.nan)
        if index != tick.leader and off_m > max_m:
            max_m, farthest = off_m, f"vehicle {identity} is {off_m:.0f} m from its slot"
    return farthest


def _to_path(station: Station) -> str:
    """Return how long the leader still flies to the start of its path at least."""
    guidance = station.controller.guidance
    if guidance.route is None or not guidance.speed_mps > 0.0:
        return ""
    left_m = -guidance.distance_m if guidance.on_path else guidance.route.length_m - guidance.distance_m
    left_s = max(left_m, 0.0) / guidance.speed_mps + (0.0 if guidance.on_path else guidance.settle_s)
    return f"the leader is at the start of its path in {left_s:.0f} s at least"
