"""The search of the nearest scenario that flies.

The means are tried in the order that `repair.order` sets, each only against violations that it may help against. The
best draft of a means stays if it is better than the one before; so the first means does most, and a later one what is
left. If waypoints would have to be moved farther than `repair.move_max_m`, other means come first, and farther moves
last. In the end every change of a setting that turns out not to be needed is taken back.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Collection, Iterator
from dataclasses import dataclass, replace
from functools import cached_property
from pathlib import Path
from typing import Any

import yaml

from formation_scenario.expectation_rules import expectations
from formation_scenario.fields import Problem
from formation_scenario.load import UnflyableError, read_scenario
from formation_scenario.registry import Files, load_extensions
from formation_scenario.repair.draft import Change, Draft, Waypoint
from formation_scenario.repair.points import HELPED, Points
from formation_scenario.repair.settings import SETTINGS
from formation_scenario.repair_plan import RepairPlan
from formation_scenario.source import Dumper, KeyPath
from formation_scenario.violations import Violation, reported

BETTER = 1e-6
REPORTED_M = 0.05
SETTLED_FIRST = ("path speed", "wind", "separation", "frame")
"""Kinds of violations against which no points help: their settings come before the points."""
FARTHEST_M = 1e6
NEEDLESS: tuple[KeyPath, ...] = (
    ("formation", "frame"),
    ("formation", "shape"),
    ("path", "climb"),
    ("path", "speed_mps"),
)
PLANNED = ("separation", "frame", "start", "step", "change", "path speed")
"""Kinds of violations that aren't a matter of single waypoints."""
LISTED = 4
"""Number of changes that are named as what would do against one violation."""
NEAR_WAYPOINTS = 1
"""Changes of a waypoint and of those so many before and after it are said to do away with a violation there."""


@dataclass(frozen=True)
class Repair:
    """What became of a scenario: the draft that flies, or the best one, and the one as given."""

    given: Draft
    found: Draft
    whole: bool = True
    """Whether all means were tried, rather than as many as the work that was allowed."""

    @property
    def flies(self) -> bool:
        """Whether nothing is left that can't be flown."""
        return not self.found.violations

    @cached_property
    def changes(self) -> list[Change]:
        """What differs from the scenario as given."""
        return self.found.changes_from(self.given)

    @property
    def problems(self) -> list[Problem]:
        """What can't be flown in the scenario as given, and what would do; `load_scenario` raises the same without."""
        return _problems(self.given, self.would_do)

    @property
    def left(self) -> list[Problem]:
        """What `check` refuses in the repaired scenario: what can't be flown, and expectations that can't be met."""
        return _problems(self.found, lambda _: "")

    def would_do(self, violation: Violation) -> str:
        """Return which of the changes do away with a violation of the scenario as given, or what is in the way."""
        near = [str(each) for each in self.changes if _concerns(each, violation)]
        left = [each for each in self.found.violations if each.kind == violation.kind]
        if left and not self.whole:
            return "; ".join(_in_words(*each) for each in violation.moves.items())
        if left:
            return f"nothing was found; in the way: {left[0].allowed}"
        more = [f"{len(near) - LISTED} more changes"] if len(near) > LISTED else []
        return "; ".join([*near[:LISTED], *more])

    def text(self) -> str:
        """Return the repaired scenario as YAML, with its changes as comments."""
        lines = [f"# {each}\n" for each in self.changes]
        keys = yaml.dump(
            self.found.source.data,
            Dumper=Dumper,
            sort_keys=False,
            allow_unicode=True,
            default_flow_style=None,
            width=110,
        )
        return f"# repaired by gcs-formation check --repair:\n{''.join(lines)}{keys}"


def _in_words(waypoint: int, move: Waypoint) -> str:
    """Return the move of a waypoint, of first order, in words."""
    components = zip(move, (("north", "south"), ("east", "west"), ("up", "down")), strict=True)
    by = [f"{abs(each):.1f} m {names[each < 0.0]}" for each, names in components if abs(each) >= REPORTED_M]
    return f"path.waypoints_m.{waypoint}: some {' and '.join(by)}"


def _problems(draft: Draft, would_do: Callable[[Violation], str]) -> list[Problem]:
    source, unmet = draft.source, expectations(draft.scenario)
    unflyable = [source.problem(*each) for each in reported(draft.violations, would_do)]
    return [*unflyable, *(source.problem(*each) for each in unmet)]


def _concerns(change: Change, violation: Violation) -> bool:
    if change.waypoint is None or violation.waypoint is None:
        return change.waypoint is None or violation.kind in PLANNED
    if change.waypoint in violation.moves:
        return True
    return not violation.moves and abs(change.waypoint - violation.waypoint) <= NEAR_WAYPOINTS


def repair(
    source: str | Path | dict[Any, Any],
    overrides: tuple[str, ...] = (),
    plugins: Files = (),
    max_m: float = math.inf,
) -> Repair:
    """Return the nearest scenario that flies, or the best that was found.

    Args:
        source: a scenario's file or mapping.
        overrides: `dotted.key=value` settings.
        plugins: files whose extensions it may use.
        max_m: the length of paths that are checked altogether, after which the search ends.

    Raises:
        ScenarioError: values that aren't allowed, or contradict each other, which isn't a matter of flying.
    """
    registry = load_extensions(plugins)
    draft = Draft(read_scenario(source, overrides, registry), registry, ())
    given = replace(draft, origins=tuple(range(len(draft.scenario.path.waypoints_m))))
    return _Search(given, max_m).repair()


def repair_refused(error: UnflyableError, max_m: float = math.inf) -> Repair:
    """Return the same for a scenario that `load_scenario` refused."""
    return _Search(Draft.of_refused(error), max_m).repair()


class _Search:
    """The search for one scenario, and how much of it is left, by the length of the paths that are checked."""

    def __init__(self, given: Draft, max_m: float) -> None:
        self._given, self._left_m = given, max_m
        self._plan = given.scenario.repair or RepairPlan()

    def repair(self) -> Repair:
        order, given, found = self._plan.order, self._given, self._given
        for means in order:
            found = self._by(means, found, self._plan.move_max_m, SETTLED_FIRST)
        for move_max_m in (self._plan.move_max_m, FARTHEST_M):
            for means in (*order, *(each for each in order if each == "points")):
                found = self._by(means, found, move_max_m)
            if not found.violations:
                return Repair(given, _without_needless(found, given))
        return Repair(given, found, self._left_m > 0.0)

    def _judge(self, draft: Draft, kinds: Collection[str]) -> float:
        if not draft.judged:
            self._left_m -= draft.work_m
        return draft.badness(kinds)

    def _by(self, means: str, draft: Draft, move_max_m: float, kinds: Collection[str] = ()) -> Draft:
        """Return the best draft by one means, or the present one, judged by some kinds of violations or by all."""
        best, minimum = draft, self._judge(draft, kinds)
        for each in self._drafts(means, draft, move_max_m, kinds) if minimum > 0.0 else ():
            if self._left_m <= 0.0:
                break
            badness = self._judge(each, kinds)
            if badness < minimum - BETTER or badness == minimum == 0.0:
                best, minimum = each, badness
        return best

    def _drafts(self, means: str, draft: Draft, move_max_m: float, kinds: Collection[str]) -> Iterator[Draft]:
        """Yield the drafts of one means that may help against what can't be flown."""
        far = move_max_m == FARTHEST_M
        if means == "points":
            if draft.has(*HELPED) and not kinds:
                yield from Points(draft, move_max_m, far=far).drafts()
            return
        helped, drafts = SETTINGS[means]
        if not draft.has(*(each for each in helped if not kinds or each in kinds)):
            return
        if means != "legs":
            yield from drafts(draft, lambda each: self._judge(each, kinds))
            return
        for each in drafts(self._given, lambda each: self._judge(each, kinds)):  # of the points as given
            yield each
            if self._judge(each, kinds) > 0.0:
                yield from Points(each, move_max_m, far=far).drafts()


def _without_needless(found: Draft, given: Draft) -> Draft:
    """Return the draft without the settings that aren't needed: each is taken back by itself."""
    for keys in NEEDLESS:
        before = given.value(keys)
        if found.value(keys) == before or isinstance(before, list):
            continue
        tried = found.changed(keys, before) if before is not None else found.without(keys)
        if tried.badness() == 0.0:
            found = tried
    return found
