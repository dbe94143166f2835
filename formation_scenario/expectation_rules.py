"""Rules of expectations: bounds, windows, and whom they are of."""

from __future__ import annotations

import math
from collections.abc import Iterator

from flight_model.path import PathError
from formation_scenario.expectation import (
    FENCE,
    FOLLOWER_METRICS,
    LINK_METRICS,
    METRICS,
    OF_FOLLOWERS,
    SEPARATION,
    WINDOWED,
    Expectation,
    pointless,
)
from formation_scenario.model import Scenario
from formation_scenario.planned_progress import latest_end_s
from formation_scenario.source import Finding, KeyPath


def measurable(scenario: Scenario) -> Iterator[Finding]:
    """Yield expectations without a subject: of followers if there are none, or of a single vehicle's separation."""
    for index, entry in enumerate(scenario.expect):
        path: KeyPath = ("expect", index, "metric")
        if entry.metric in OF_FOLLOWERS and not scenario.followers:
            found = f"found {entry.metric} of a formation without followers"
            yield path, found, "one or more followers, or a figure that needs none"
        elif entry.metric == SEPARATION and len(scenario.vehicles) == 1:
            yield path, f"found {entry.metric} of one vehicle", "two or more vehicles, or a figure that needs one alone"
        elif entry.metric == FENCE and scenario.fence is None:
            yield path, f"found {entry.metric} without a fence", "safety.fence, or a figure that needs none"


def ranges(scenario: Scenario) -> Iterator[Finding]:
    """Yield bounds outside a figure's possible values."""
    for index, entry in enumerate(scenario.expect):
        for name, found, allowed in pointless(entry.metric, entry.below, entry.above):
            yield ("expect", index, name), found, allowed


def expectations(scenario: Scenario) -> Iterator[Finding]:
    """Yield expectations without a subject or a bound, with a window that is never flown, or that can't be met."""
    yield from measurable(scenario)
    yield from ranges(scenario)
    end_s = _latest_end_s(scenario)
    for index, entry in enumerate(scenario.expect):
        path: KeyPath = ("expect", index)
        if entry.below is None and entry.above is None:
            yield path, "found no bound", "below, above or both"
        if entry.metric in METRICS and entry.metric not in WINDOWED:
            yield from _part_of_flight(entry, path, scenario.duration_s)
        elif entry.from_s >= entry.to_s:
            found = f"found a window from {entry.from_s:g} to {entry.to_s:g} s"
            yield (*path, "from_s"), found, "from_s before to_s"
        elif entry.from_s >= end_s:
            allowed = f"less than {end_s:.1f} s, when the flight is over at the latest"
            yield (*path, "from_s"), f"found {entry.from_s:g}", allowed
        if entry.metric not in (*FOLLOWER_METRICS, *LINK_METRICS) and entry.followers != "all":
            yield (*path, "followers"), f"found followers for {entry.metric}, a figure of the whole run", "all"
        if entry.below is not None and entry.above is not None and entry.below <= entry.above:
            yield (*path, "below"), f"found above {entry.above:g} and below {entry.below:g}", "more than above"


def _part_of_flight(entry: Expectation, path: KeyPath, duration_s: float) -> Iterator[Finding]:
    """Yield the ends of a window for a figure that has no window."""
    of = f"for {entry.metric}, a figure of the whole flight"
    if entry.from_s > 0.0:
        yield (*path, "from_s"), f"found {entry.from_s:g} {of}", "0, or nothing"
    if entry.to_s < duration_s:
        yield (*path, "to_s"), f"found {entry.to_s:g} {of}", f"duration_s, {duration_s:g}, or nothing"


def _latest_end_s(scenario: Scenario) -> float:
    if not any(entry.from_s for entry in scenario.expect):
        return scenario.duration_s
    try:
        return latest_end_s(scenario)
    except PathError:  # reported by the rule `path`
        return math.inf
