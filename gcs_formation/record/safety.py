"""The section `safety` of summary.json: how near a flight came to each limit, which it broke, and what wasn't seen."""

from __future__ import annotations

from collections.abc import Iterator
from typing import Any, NamedTuple

import numpy as np

from airlink.endpoint import VehicleId
from flight_model.arrays import Mask
from formation_scenario import Scenario
from formation_scenario.fields import distinct_texts
from gcs_formation.record import figures_of_merit as figures
from gcs_formation.record.flight import RecordedFlight
from gcs_formation.record.limits_by_truth import Columns, LimitSeries
from gcs_formation.record.path_distance import OFF_PATH_S, off_path
from gcs_formation.record.timeseries import PHASES, POSITION, TRUTH


class Safety(NamedTuple):
    """What a flight's limits came to."""

    figures: dict[str, Any]
    breaches: tuple[str, ...]
    """Broken limits, in words with their figures."""
    off_path: tuple[str, ...]
    """Times off the path, which is a limit too, in words."""


def safety(scenario: Scenario, flight: RecordedFlight, limits: LimitSeries) -> Safety:
    """Return the figures of the whole flight, from the first take-off to the last acknowledgement at its end."""
    fenced, off = scenario.fence is not None, list(off_path(scenario, limits.track))
    broken = [
        limits.separation_m < scenario.safety.separation_m,
        limits.clearance_m < scenario.safety.clearance_m,
        limits.fence_m > 0.0,
    ]
    whole = np.ones(flight.mission_time_s.shape, dtype=bool)
    found = {
        "min_separation_m": figures.minimum(limits.separation_m),
        "min_clearance_m": figures.minimum(limits.clearance_m),
        "fence_m": float(limits.fence_m.max(initial=0.0)) if fenced else None,
        "violations": sum(map(_episodes, broken)) + len(off),
        "avoidance_s": figures.avoidance_s(flight, whole, scenario.law.rate_hz) if whole.size else 0.0,
        "unseen_s": float(sum(to_s - from_s for from_s, to_s in limits.unseen_s)),
        "outside_by_pilot_m": {str(each.vehicle): each.outside_m for each in limits.by_pilots},
    }
    names = list(flight.vehicles)
    words = tuple(
        f"{_leader(names, each.vehicle)} was up to {each.farthest_m:.1f} m off its path, at "
        f"{each.farthest_at_s:.1f} s, and too far for {each.for_s:.1f} s; allowed: "
        f"{scenario.safety.path_distance_m:g} m, and more for less than {OFF_PATH_S:g} s (safety.path_distance_m)"
        for each in off
    )
    return Safety(found, tuple(_breaches(scenario, flight, limits)), words)


def _leader(names: list[VehicleId], column: int) -> str:
    return "the virtual leader" if column < 0 else f"the leader, vehicle {names[column]},"


def _breaches(scenario: Scenario, flight: RecordedFlight, limits: LimitSeries) -> Iterator[str]:
    """Yield in words each limit that was broken, at its worst."""
    allowed = scenario.safety
    for name, values, min_m in (
        ("separation", limits.separation_m, allowed.separation_m),
        ("clearance", limits.clearance_m, allowed.clearance_m),
    ):
        if (values < min_m).any():
            worst = int(np.nanargmin(values))
            found, minimum = distinct_texts(float(values[worst]), min_m)
            yield f"safety broken: {name} was {found} m {_when(flight, limits, worst)}; allowed: {minimum} m or more"
    if (limits.fence_m > 0.0).any():
        worst = int(limits.fence_m.argmax())
        who, outside_m = list(flight.vehicles)[limits.farthest[worst]], float(limits.fence_m[worst])
        where, allowed_there = _left_by(scenario, flight.vehicles[who], int(limits.tick[worst]))
        breach = f"vehicle {who} was {outside_m:.3g} m {where} {_when(flight, limits, worst)}"
        yield f"safety broken: {breach}; allowed: {allowed_there}"


def _left_by(scenario: Scenario, own: Columns, tick: int) -> tuple[str, str]:
    """Return which part of the fence a vehicle had left at a tick, and what is allowed, in words."""
    sides = None if scenario.fence is None else scenario.fence.sides
    if sides is not None and tick >= 0:
        north, east = (TRUTH if TRUTH[0] in own else POSITION)[:2]
        position_m = np.array((own[north][tick], own[east][tick]))
        area = sides.nearest(position_m)
        if not area.inclusion and sides.inside_m(position_m) < 0.0:
            return f"inside the {area}", f"outside it ({area.key})"
    return "outside the fence", "inside it (safety.fence)"


def _when(flight: RecordedFlight, limits: LimitSeries, row: int) -> str:
    """Return in words when an instant was, by mission time if there is one, and in which phase if not on the path."""
    common, tick, at_s = flight.common, int(limits.tick[row]), float(limits.time_s[row])
    if tick < 0:
        return f"{at_s:.1f} s after the start"
    mission_s, phase = float(common["mission_time_s"][tick]), PHASES[int(common["phase"][tick])]
    if np.isnan(mission_s):
        return f"{at_s:.1f} s after the start ({phase})"
    mission_s += at_s - float(common["t_s"][tick])
    return f"at {mission_s:.1f} s" + ("" if phase == "flying" else f" ({phase})")


def _episodes(broken: Mask) -> int:
    """Return how many times a limit began to be broken."""
    return int(broken[:1].sum()) + int((broken[1:] & ~broken[:-1]).sum())


def value_within(flight: RecordedFlight, metric: str, from_s: float, to_s: float) -> float | None:
    """Return a limit's figure over a window of mission time on the path; None without one, or if none flew then."""
    limits = flight.limits
    if limits is None:
        return None
    window = _within(flight, limits, from_s, to_s)
    if not window.any():
        return None
    if metric == "fence_m":
        return float(limits.fence_m[window].max())
    if metric == "min_clearance_m":
        return figures.minimum(limits.clearance_m[window])
    return float(limits.separation_m[window].min())


def _within(flight: RecordedFlight, limits: LimitSeries, from_s: float, to_s: float) -> Mask:
    """Return a (K,) mask of the instants in a window of mission time on the path, ends included."""
    flying, mission_s = flight.window(-np.inf, np.inf), flight.mission_time_s
    if not flying.any():
        return np.zeros(limits.time_s.shape, dtype=bool)
    tick = np.maximum(limits.tick, 0)
    time_s = mission_s[tick] + limits.time_s - flight.common["t_s"][tick]
    within: Mask = (limits.tick >= 0) & flying[tick] & (time_s >= from_s - 1e-9) & (time_s <= to_s + 1e-9)
    return within
