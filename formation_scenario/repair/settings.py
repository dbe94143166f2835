"""Repair by settings: what each means may change beside the path's points, the nearest values first."""

from __future__ import annotations

import math
from collections.abc import Callable, Iterator, Mapping
from functools import cache
from typing import get_args

import numpy as np

from formation_scenario.fields import Frame
from formation_scenario.formation import CUSTOM, SHAPE_NAMES
from formation_scenario.model import Scenario
from formation_scenario.repair.draft import Draft
from formation_scenario.slot_assignment import slot_schedule
from formation_scenario.source import KeyPath, Plain
from formation_scenario.turn_limits import turns_well

Judge = Callable[[Draft], float]
"""How much can't be flown in a draft: 0 if all can."""
SLOTS = ("slot turn", "slot speed", "slot acceleration", "slot setpoint")
SPEED: KeyPath = ("path", "speed_mps")
SHARES = (0.97, 0.94, 0.9, 0.85, 0.8, 0.7, 0.6, 0.5)
"""Shares of a spacing that are tried in this order."""
OFF = (0.05, 0.1, 0.2, 0.3, 0.45, 0.6, 0.8, 1.0)
"""Shares of the range from a speed to its lowest or highest, likewise."""
LARGEST = 8.0
HALVINGS = 7
TRIED = 25
"""Number of speeds of the whole range of which is known how well the formation turns."""
LATER_S = (5.0, 10.0, 20.0, 40.0, 80.0)


def by_legs(draft: Draft, _: Judge) -> Iterator[Draft]:
    """Yield the draft with straight legs and turns that all slots can fly in place of a spline."""
    if draft.scenario.path.kind == "spline":
        yield draft.changed(("path", "kind"), "legs")


def by_circles(draft: Draft, _: Judge) -> Iterator[Draft]:
    """Yield the draft with circles where legs are too steep, and with smaller or no circles where there is no room."""
    if draft.scenario.path.kind == "spline":
        return
    if draft.has("climb"):
        yield draft.changed(("path", "climb"), "circle")
    crowded = {each.waypoint for each in draft.violations if each.kind == "circles"}
    given = draft.scenario.path.circles
    for radius_m in (0.0, None):
        kept: list[Plain] = [
            {"waypoint": each.waypoint, "turns": each.turns, "radius_m": radius_m}
            if each.waypoint in crowded and radius_m is not None
            else {"waypoint": each.waypoint, "turns": each.turns, "radius_m": each.radius_m}
            for each in given
            if each.waypoint not in crowded or radius_m is not None
        ]
        if crowded:
            yield draft.changed(("path", "circles"), kept)


def by_speed(draft: Draft, judge: Judge) -> Iterator[Draft]:
    """Yield the draft at other speeds: those of all vehicles' range that are next to the planned ones."""
    scenario = draft.scenario
    low, high = _range_mps(scenario)
    if low > high:
        return

    @cache
    def at(share: float) -> Draft:
        """Return the draft with speeds moved within the range: -1 to its lowest, 1 to its highest."""
        speeds = [_moved(min(max(each, low), high), low, high, share) for each in scenario.path.legs_mps]
        one = isinstance(scenario.path.speed_mps, float | int)
        return draft.changed(SPEED, speeds[0] if one else list[Plain](speeds))

    within = at(0.0)
    yield within
    for share in OFF if judge(within) > 0.0 else ():
        for sign in (-1.0, 1.0):
            yield at(sign * share)
            if judge(at(sign * share)) == 0.0:
                yield from _nearer(at, 0.0, sign * share, judge)
                return


def _range_mps(scenario: Scenario) -> tuple[float, float]:
    """Return the lowest and the highest speed of all vehicles that leave the slots some for turns."""
    ranges = [scenario.speeds_mps(vehicle) for vehicle in scenario.vehicles]
    low, high = max(low for low, _ in ranges), min(high for _, high in ranges)
    steps, windy_mps = slot_schedule(scenario), math.hypot(*scenario.drift_mps)
    turns = [each for each in np.linspace(low, high, TRIED).tolist() if turns_well(scenario, steps, each, windy_mps)]
    return (turns[0], turns[-1]) if turns else (low, high)


def _moved(speed_mps: float, low: float, high: float, share: float) -> float:
    moved = speed_mps + share * (speed_mps - low if share < 0.0 else high - speed_mps)
    rounded = round(moved, 1)
    return rounded if low <= rounded <= high else moved


def _nearer(at: Callable[[float], Draft], nearest: float, good: float, judge: Judge) -> Iterator[Draft]:
    """Yield the draft next to `nearest` that is as good as the one at `good`, by bisection."""
    for _ in range(HALVINGS):
        middle = (nearest + good) / 2.0
        if judge(at(middle)) == 0.0:
            good = middle
        else:
            nearest = middle
    yield at(good)


def by_spacing(draft: Draft, judge: Judge) -> Iterator[Draft]:
    """Yield the draft with its slots closer together, or farther apart if they are too near to each other."""
    if len(draft.scenario.vehicles) < 2:
        return

    @cache
    def at(scale: float) -> Draft:
        found = _scaled(draft, ("formation",), scale, default=draft.scenario.formation.spacing_m)
        for index, change in enumerate(draft.scenario.formation.changes):
            found = _scaled(found, ("formation", "changes", index), scale, default=change.spacing_m)
        return found

    near = draft.has("separation")
    scales = [1.0 / each for each in SHARES] + [2.0, 3.0, 5.0, LARGEST] if near else [*SHARES, 0.4, 0.3, 0.2, 0.1]
    for scale in scales:
        found = at(scale)
        yield found
        if judge(found) == 0.0:
            yield from _nearer(at, 1.0, scale, judge)
            return


def _scaled(draft: Draft, key: KeyPath, scale: float, default: float | None) -> Draft:
    """Return the draft with the spacing and the own slots of a formation, or of a change, scaled."""
    spacing, slots = draft.value((*key, "spacing_m")), draft.value((*key, "slots_m"))
    if isinstance(slots, dict):
        scaled: Plain = {
            who: [round(scale * float(str(each)), 2) for each in slot] if isinstance(slot, list) else slot
            for who, slot in slots.items()
        }
        draft = draft.changed((*key, "slots_m"), scaled)
    if spacing is None and (default is None or key != ("formation",) or isinstance(slots, dict)):
        return draft
    value = default if spacing is None else spacing
    return draft.changed((*key, "spacing_m"), round(scale * float(str(value)), 2))


def by_shape(draft: Draft, _: Judge) -> Iterator[Draft]:
    """Yield the draft in every other shape."""
    if len(draft.scenario.vehicles) < 2:
        return
    now = draft.scenario.formation.shape
    yield from (draft.changed(("formation", "shape"), shape) for shape in SHAPE_NAMES if shape not in (now, CUSTOM))


def by_frame(draft: Draft, _: Judge) -> Iterator[Draft]:
    """Yield the draft in every other frame."""
    now = draft.scenario.formation.frame
    if len(draft.scenario.vehicles) > 1 and not draft.scenario.hovers:
        yield from (draft.changed(("formation", "frame"), frame) for frame in get_args(Frame) if frame != now)


def by_start(draft: Draft, _: Judge) -> Iterator[Draft]:
    """Yield the draft with starts nearer to the slots, and in the air where the ground is no runway."""
    offset_m = draft.scenario.start.offset_m
    if draft.has("start") and any(offset_m):
        for share in (0.75, 0.5, 0.25, 0.0):
            yield draft.changed(("start", "offset_m"), [round(share * each, 2) for each in offset_m])
    if draft.has("start") and not draft.scenario.start.in_air:
        yield draft.changed(("start", "in_air"), value=True)


def by_changes(draft: Draft, _: Judge) -> Iterator[Draft]:
    """Yield the draft with changes later, or without them, and with smaller steps of height."""
    for each in draft.violations:
        if each.kind == "step":
            height_m = draft.value(each.key)
            for share in (*SHARES, 0.3, 0.0) if isinstance(height_m, int | float) else ():
                yield draft.changed(each.key, round(share * float(str(height_m)), 2))
        if each.kind == "change":
            at_s = draft.value((*each.key, "at_s"))
            for later_s in LATER_S if isinstance(at_s, int | float) else ():
                yield draft.changed((*each.key, "at_s"), float(str(at_s)) + later_s)
            changes, index = draft.value(each.key[:-1]), each.key[-1]
            if isinstance(changes, list):
                yield draft.changed(each.key[:-1], [one for at, one in enumerate(changes) if at != index])


SETTINGS: Mapping[str, tuple[tuple[str, ...], Callable[[Draft, Judge], Iterator[Draft]]]] = {
    "legs": (("waypoints", "climb", "clearance", "fence", "fence height", "turn", *SLOTS), by_legs),
    "circles": (("climb", "circles"), by_circles),
    "speed": (("path speed", "wind", "climb", "turn", "fence", "circles", "change", *SLOTS), by_speed),
    "spacing": (("separation", "fence", "fence height", "clearance", "start", "change", *SLOTS), by_spacing),
    "shape": (("separation", "frame", "fence", "fence height", "clearance", "change", *SLOTS), by_shape),
    "frame": (("frame", "change", *SLOTS), by_frame),
    "start": (("start",), by_start),
    "changes": (("step", "change"), by_changes),
}
"""Of each means but points: the kinds of violations against which it may help, and its drafts."""
