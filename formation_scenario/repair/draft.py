"""A scenario that is being repaired: plain keys, what they are typed, and what can't be flown in it."""

from __future__ import annotations

import math
from collections.abc import Collection, Sequence
from dataclasses import dataclass, field, replace
from functools import cached_property
from typing import NamedTuple

from flight_model.legs.detour import Detours
from flight_model.legs.turn import TurnLimits
from flight_model.path import PathError
from formation_scenario.feasibility import check
from formation_scenario.fields import ScenarioError
from formation_scenario.load import UnflyableError, to_the_paths_end
from formation_scenario.model import Scenario
from formation_scenario.registry import Registry
from formation_scenario.rules import inconsistencies
from formation_scenario.sampled_path import WAYPOINTS
from formation_scenario.source import Key, KeyPath, Plain, Source, dotted, show
from formation_scenario.violations import Violation

MAX_EXCESS = 10.0
"""Excess from which on a violation isn't counted as worse."""
SAME_M = 0.006
OF_WAYPOINT_M = 200.0
Waypoint = tuple[float, float, float]


class Change(NamedTuple):
    """One difference between the repaired and the given scenario."""

    key: str
    text: str
    waypoint: int | None = None
    """Index of the waypoint in the given scenario, if it is a matter of one."""

    def __str__(self) -> str:
        return f"{self.key}: {self.text}"


@dataclass(frozen=True)
class Draft:
    """A scenario with some keys changed.

    `origins` are the indices of its waypoints in the scenario as given, None for those that were added.
    """

    source: Source
    registry: Registry
    origins: tuple[int | None, ...]
    detours: dict[TurnLimits, Detours] = field(default_factory=dict[TurnLimits, Detours])
    """Those of all drafts, by their limits: most waypoints are the same."""

    @cached_property
    def scenario(self) -> Scenario:
        """The scenario, typed.

        Raises:
            ScenarioError: a key with a value that isn't allowed.
        """
        return to_the_paths_end(self.source, self.registry, self.detours)[0]

    @cached_property
    def violations(self) -> list[Violation]:
        """What can't be flown; waypoints through which no path leads come before all else.

        Raises:
            ScenarioError: keys that contradict each other, which isn't a matter of flying.
        """
        found = inconsistencies(self.scenario)
        others = [each for each in found if each[0][:2] != WAYPOINTS]
        if others:
            raise ScenarioError([self.source.problem(*each) for each in others])
        if found:
            return [Violation(*each, "waypoints", waypoint=_index(each[0])) for each in found]
        return check(self.scenario)

    @classmethod
    def of_refused(cls, error: UnflyableError) -> Draft:
        """Return the draft of a scenario that `load_scenario` refused, of which all is known."""
        scenario = error.scenario
        draft = cls(error.source, scenario.registered, tuple(range(len(scenario.path.waypoints_m))), scenario.detours)
        vars(draft).update(scenario=scenario, violations=error.violations)
        return draft

    def badness(self, kinds: Collection[str] = ()) -> float:
        """Return how much can't be flown, by number and size of violations, of some kinds alone if given; 0 if all can.

        Infinite of keys that contradict each other.
        """
        try:
            found = self.violations
        except ScenarioError:
            return math.inf
        return sum(1.0 + min(max(each.excess, 0.0), MAX_EXCESS) for each in found if not kinds or each.kind in kinds)

    @property
    def judged(self) -> bool:
        """Whether its violations are known."""
        return "violations" in vars(self)

    @property
    def work_m(self) -> float:
        """How much work it is to judge it, as a length of path: its own, and some for each waypoint."""
        try:
            return self.scenario.written_path.length_m + OF_WAYPOINT_M * len(self.origins)
        except (PathError, ScenarioError):
            return 0.0

    def has(self, *kinds: str) -> bool:
        """Return whether there are violations of some kinds."""
        return any(each.kind in kinds for each in self.violations)

    def value(self, path: KeyPath) -> Plain:
        """Return the value of a key as written; None if it isn't."""
        return _value(self.source.data, path)

    def changed(self, path: KeyPath, value: Plain) -> Draft:
        """Return the draft with another value of a key."""
        return replace(self, source=replace(self.source, data=_changed(self.source.data, path, value)))

    def without(self, path: KeyPath) -> Draft:
        """Return the draft without a key of a group."""
        group = self.value(path[:-1])
        assert isinstance(group, dict)
        return self.changed(path[:-1], {name: value for name, value in group.items() if name != path[-1]})

    def with_waypoints(self, waypoints: Sequence[Waypoint], origins: Sequence[int | None]) -> Draft:
        """Return the draft with other waypoints; speeds, circles and stops stay at their legs and waypoints."""
        path, plan, legs = ("path",), self.scenario.path, list[Plain]()
        own = dict(zip(self.origins, plan.waypoints_m, strict=True))
        named = zip(origins, waypoints, strict=True)
        written = [_written(point, None if origin is None else own.get(origin)) for origin, point in named]
        found = self.changed((*path, "waypoints_m"), list[Plain](written))
        at = {origin: index for index, origin in enumerate(origins) if origin is not None}
        if isinstance(plan.speed_mps, tuple):
            last = len(self.origins) - 1
            for origin in reversed(origins[1:]):
                last = last if origin is None else self.origins.index(origin)
                legs.insert(0, plan.legs_mps[last - 1])
            found = found.changed((*path, "speed_mps"), legs)
        if plan.circles:
            of = [(each, self.origins[each.waypoint]) for each in plan.circles]
            kept: list[Plain] = [
                {"waypoint": at[origin], "turns": each.turns, "radius_m": each.radius_m}
                for each, origin in of
                if origin is not None and origin in at
            ]
            found = found.changed((*path, "circles"), kept)
        if plan.stops:
            stopped = [(each, self.origins[each.waypoint]) for each in plan.stops]
            held: list[Plain] = [
                {"waypoint": at[origin], "hold_s": each.hold_s}
                for each, origin in stopped
                if origin is not None and 0 < at.get(origin, 0) < len(origins) - 1
            ]
            found = found.changed((*path, "stops"), held)
        return replace(found, origins=tuple(origins))

    def changes_from(self, given: Draft) -> list[Change]:
        """Return what differs from another draft: each waypoint, and each other key."""
        return [*_waypoint_changes(self, given), *_key_changes(given.source.data, self.source.data, ())]


def _written(point: Waypoint, before: Waypoint | None) -> list[Plain]:
    """Return a waypoint to centimetres, with what was written before where it is the same to as much."""
    pairs = zip(point, point if before is None else before, strict=True)
    return [was if before is not None and abs(now - was) < SAME_M else round(now, 2) for now, was in pairs]


def _index(path: KeyPath) -> int | None:
    return path[2] if len(path) > 2 and isinstance(path[2], int) else None


def _value(data: Plain, path: KeyPath) -> Plain:
    for each in path:
        if isinstance(data, dict):
            data = data.get(each)
        elif isinstance(data, list) and isinstance(each, int) and each < len(data):
            data = data[each]
        else:
            return None
    return data


def _changed(data: dict[Key, Plain], path: KeyPath, value: Plain) -> dict[Key, Plain]:
    first, *rest = path
    if not rest:
        return data | {first: value}
    inner = data.get(first)
    if isinstance(inner, list):
        return data | {first: _changed_item(inner, tuple(rest), value)}
    return data | {first: _changed(inner if isinstance(inner, dict) else {}, tuple(rest), value)}


def _changed_item(items: list[Plain], path: KeyPath, value: Plain) -> list[Plain]:
    index, *rest = path
    assert isinstance(index, int)
    item, found = items[index], list(items)
    if not rest:
        found[index] = value
    elif isinstance(item, list):
        found[index] = _changed_item(item, tuple(rest), value)
    else:
        found[index] = _changed(item if isinstance(item, dict) else {}, tuple(rest), value)
    return found


def _waypoint_changes(now: Draft, given: Draft) -> list[Change]:
    """Return what became of each waypoint, in the order of the path."""
    before, after = given.scenario.path.waypoints_m, now.scenario.path.waypoints_m
    found, last, kept = list[Change](), 0, set(now.origins)
    for index, (origin, point) in enumerate(zip(now.origins, after, strict=True)):
        if origin is None:
            found.append(Change(f"path.waypoints_m.{index}", f"added {_point(point)}, after waypoint {last}", last))
            continue
        for left_out in (each for each in range(last + 1, origin) if each not in kept):
            found.append(Change(f"path.waypoints_m.{left_out}", f"left out {_point(before[left_out])}", left_out))
        last = origin
        if point != before[origin]:
            by = " and ".join(_moved(before[origin], point))
            text = f"moved {by}, from {_point(before[origin])} to {_point(point)}"
            found.append(Change(f"path.waypoints_m.{origin}", text, origin))
    return found


def _moved(before: Waypoint, after: Waypoint) -> list[str]:
    north_m, east_m, up_m = (b - a for a, b in zip(before, after, strict=True))
    level_m = (north_m**2 + east_m**2) ** 0.5
    words = [f"{level_m:.1f} m horizontally"] if level_m >= 0.005 else []
    return [*words, *([f"{abs(up_m):.1f} m {'up' if up_m > 0.0 else 'down'}"] if up_m else [])]


def _point(point: Sequence[float]) -> str:
    return f"[{', '.join(f'{each:.8g}' for each in point)}]"


def _key_changes(before: Plain, after: Plain, path: KeyPath) -> list[Change]:
    if path == WAYPOINTS or before == after:
        return []
    if isinstance(after, dict) and isinstance(before, dict | None):
        inner = before or {}
        keys = dict.fromkeys([*inner, *after])
        return [each for key in keys for each in _key_changes(inner.get(key), after.get(key), (*path, key))]
    if isinstance(before, list) and isinstance(after, list) and len(before) == len(after):
        pairs = enumerate(zip(before, after, strict=True))
        return [each for index, pair in pairs for each in _key_changes(*pair, (*path, index))]
    was = "by default" if before is None else f"from {show(before)}"
    return [Change(dotted(path), f"left out {show(before)}" if after is None else f"{was} to {show(after)}")]
