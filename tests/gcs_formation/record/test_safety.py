"""What is said of a flight's limits: the figures of the whole flight, each limit that was broken, and when."""

from __future__ import annotations

import math
from dataclasses import replace
from typing import Any, cast

import numpy as np
import pytest

from flight_model.arrays import Array
from formation_scenario import Scenario
from gcs_formation.record.flight import RecordedFlight
from gcs_formation.record.limits_by_truth import LimitSeries, PilotOutside, Track, limit_series
from gcs_formation.record.safety import safety, value_within
from tests.gcs_formation.record.test_limits_by_truth import (
    ENDS_S,
    FENCED,
    FOLLOWER,
    LEADER,
    OPEN,
    TICKS_S,
    TRUTH_S,
    reader,
    ticks,
    with_areas,
)

AT_S = TRUTH_S[(TRUTH_S >= 1.0) & (TRUTH_S <= ENDS_S)]
"""Instants at which limits are judged; ticks begin at 2 s, the path at 5 s, vehicles loiter from 15 s on."""


def flown(scenario: Scenario = OPEN, *vehicles: dict[str, Any], **limits: Any) -> Any:
    """Return a flight of two vehicles, and its distances with some of them replaced."""
    recorded = ticks(*(vehicles or ({}, {})))
    for own in recorded.values():
        own["yielding"] = np.zeros(TICKS_S.size)
    found = limit_series(scenario, recorded, reader(*vehicles), {}, ENDS_S) if vehicles else APART[id(scenario)]
    return RecordedFlight(recorded, limits=replace(found, **limits))


APART = {id(scenario): limit_series(scenario, ticks({}, {}), reader({}, {}), {}, ENDS_S) for scenario in (OPEN, FENCED)}
"""The distances of two vehicles that stay 30 m apart, 50 m high."""


def at(values: dict[float, float], otherwise: float) -> Array:
    """Return distances at the instants, other ones at some of them."""
    found = np.full(AT_S.size, otherwise)
    for at_s, value in values.items():
        found[int(np.abs(AT_S - at_s).argmin())] = value
    return found


def judged(scenario: Scenario, flight: RecordedFlight) -> Any:
    return safety(scenario, flight, cast("LimitSeries", flight.limits))


def test_a_flight_within_its_limits_has_figures_and_breaks_none() -> None:
    """Without a fence none is outside of it, which isn't known to be 0."""
    found = judged(OPEN, flown())
    assert found.figures == {
        "min_separation_m": pytest.approx(30.0),
        "min_clearance_m": pytest.approx(50.0),
        "fence_m": None,
        "violations": 0,
        "avoidance_s": 0.0,
        "unseen_s": 0.0,
        "outside_by_pilot_m": {},
    }
    assert (found.breaches, found.off_path) == ((), ())
    assert judged(FENCED, flown(FENCED)).figures["fence_m"] == 0.0


def test_figures_are_of_the_whole_flight() -> None:
    """The time out of sight is summed; a second of a vehicle that yields is one, however many do."""
    flight = flown(
        unseen_s=[(1.0, 2.5), (7.0, 9.0)],
        by_pilots=[PilotOutside(FOLLOWER, 12.5, 3.0)],
        separation_m=at({2.0: 9.0}, math.inf),
        clearance_m=at({19.0: 7.0}, math.nan),
    )
    for own in flight.vehicles.values():
        own["yielding"] = (TICKS_S < 2.95).astype(float)
    figures = judged(OPEN, flight).figures
    names = ("unseen_s", "avoidance_s", "min_separation_m", "min_clearance_m")
    assert [figures[name] for name in names] == pytest.approx([3.5, 1.0, 9.0, 7.0])
    assert figures["outside_by_pilot_m"] == {"2": 12.5}


def test_each_time_that_a_limit_begins_to_be_broken_is_a_violation() -> None:
    """Bounds themselves are kept: 10 m of separation and 5 m of clearance by default."""
    allowed = OPEN.safety
    near = {1.0: 1.0, 3.0: allowed.separation_m, 4.0: 2.0, 4.04: 3.0, 4.12: 2.5, ENDS_S: 0.5}
    low = {6.0: allowed.clearance_m, 7.0: allowed.clearance_m - 0.001}
    broken = judged(OPEN, flown(separation_m=at(near, 30.0), clearance_m=at(low, 50.0)))
    assert broken.figures["violations"] == 4 + 1
    assert len(broken.breaches) == 2
    out = judged(FENCED, flown(FENCED, fence_m=at({8.0: 0.001, 9.0: 4.0}, 0.0)))
    assert (out.figures["violations"], out.figures["fence_m"]) == (2, 4.0)


@pytest.mark.parametrize(
    ("at_s", "when"),
    [
        (1.48, "1.5 s after the start"),
        (2.0, "2.0 s after the start (assembling)"),
        (4.96, "5.0 s after the start (assembling)"),
        (8.0, "at 3.0 s"),
        (8.08, "at 3.1 s"),
        (16.0, "at 11.0 s (loitering)"),
    ],
)
def test_a_broken_limit_is_said_at_its_worst_with_the_bound_and_when_that_was(at_s: float, when: str) -> None:
    """By mission time once there is one, and in which phase if that isn't the flight along the path."""
    earlier = {1.2: 8.0, at_s: 2.345}
    found = judged(OPEN, flown(separation_m=at(earlier, 30.0))).breaches
    minimum = f"{OPEN.safety.separation_m:g}"
    assert found == (f"safety broken: separation was 2.35 m {when}; allowed: {minimum} m or more",)
    low = judged(OPEN, flown(clearance_m=at({at_s: -3.0}, math.nan))).breaches
    assert low == (f"safety broken: clearance was -3 m {when}; allowed: {OPEN.safety.clearance_m:g} m or more",)


def test_a_figure_that_breaks_its_bound_by_little_is_reported_apart_from_it() -> None:
    minimum_m = OPEN.safety.separation_m
    (found,) = judged(OPEN, flown(separation_m=at({8.0: minimum_m - 1e-5}, 30.0))).breaches
    assert f"separation was {minimum_m - 1e-5:.7g} m" in found


def test_who_was_outside_the_fence_is_said_at_the_farthest() -> None:
    """The follower is 7 m beyond the side from 5 s on, and the leader 2 m above the top."""
    flight = flown(FENCED, {"height_m": 62.0}, {"north_m": 407.0})
    (found,) = judged(FENCED, flight).breaches
    assert found == ("safety broken: vehicle 2 was 7 m outside the fence at 0.0 s; allowed: inside it (safety.fence)")
    (above,) = judged(FENCED, flown(FENCED, {"height_m": 62.0}, {})).breaches
    assert above.startswith("safety broken: vehicle 1 was 2 m outside the fence")


def test_who_was_in_an_area_to_stay_out_of_is_said_to_have_been_inside_it() -> None:
    """Also before the first tick, at which it isn't known where that was."""
    circle = {"kind": "exclusion", "centre_m": [200, 0], "radius_m": 30}
    scenario = with_areas(circle)
    flight = flown(scenario, {}, {"north_m": 190.0})
    for own in flight.vehicles.values():
        own |= {f"true_{name}": own[name] for name in ("north_m", "east_m", "height_m")}
    (found,) = judged(scenario, flight).breaches
    area = scenario.fence.sides.nearest(np.array((190.0, 0.0)))  # type: ignore[union-attr]
    assert f"vehicle 2 was 20 m inside the {area} at 0.0 s; allowed: outside it (safety.fence.areas.0)" in found
    limits: LimitSeries = flight.limits
    early = replace(limits, fence_m=at({1.0: 5.0}, 0.0), farthest=np.ones(AT_S.size, dtype=np.intp))
    (said,) = judged(scenario, replace(flight, limits=early)).breaches
    assert "outside the fence 1.0 s after the start" in said
    flight.vehicles[FOLLOWER]["true_north_m"] = np.full(TICKS_S.size, 450.0)
    assert "outside the fence" in judged(scenario, flight).breaches[0], "by the true place"


@pytest.mark.parametrize(
    ("leader", "who"), [(0, "the leader, vehicle 1,"), (1, "the leader, vehicle 2,"), (-1, "the virtual leader")]
)
def test_a_leader_that_was_off_its_path_for_too_long_is_a_violation_in_words(leader: int, who: str) -> None:
    time_s = np.arange(0.0, 30.0, 0.5)
    east_m = np.where((time_s >= 5.0) & (time_s <= 17.0), 80.0, 0.0) + np.where(time_s == 9.0, 4.0, 0.0)
    place_m = np.stack((OPEN.path.begin_mps * time_s, east_m, np.full(time_s.size, 50.0)))
    track = Track(time_s, place_m, np.full(time_s.size, leader))
    found = judged(OPEN, flown(track=track))
    assert found.figures["violations"] == 1
    assert found.off_path == (
        f"{who} was up to 84.0 m off its path, at 9.0 s, and too far for 12.0 s; allowed: 50 m, and more for less "
        "than 10 s (safety.path_distance_m)",
    )


WITHIN = [(0.0, 10.0, 3.0), (0.0, 4.95, 7.0), (5.05, 10.0, 8.0), (5.0, 5.0, 3.0), (4.98, 5.02, 3.0)]


@pytest.mark.parametrize(("from_s", "to_s", "least_m"), WITHIN)
def test_a_limit_over_a_window_is_of_the_instants_in_it_along_the_path(
    from_s: float, to_s: float, least_m: float
) -> None:
    """Least at 10 s, which is 5 s of mission time; nearer still before and after the path, which doesn't count."""
    values = at({1.0: 1.0, 4.9: 1.0, 9.0: 7.0, 10.0: 3.0, 11.0: 8.0, 15.0: 1.0, 16.0: 1.0}, 30.0)
    flight = flown(separation_m=values, clearance_m=values + 100.0, fence_m=40.0 - values)
    assert value_within(flight, "min_separation_m", from_s, to_s) == least_m
    assert value_within(flight, "min_clearance_m", from_s, to_s) == least_m + 100.0
    assert value_within(flight, "fence_m", from_s, to_s) == 40.0 - least_m


def test_a_limit_has_no_figure_over_a_window_without_an_instant_or_of_a_flight_without_a_path() -> None:
    flight = flown()
    assert value_within(flight, "min_separation_m", 5.01, 5.02) is None
    assert value_within(replace(flight, limits=None), "min_separation_m", 0.0, 10.0) is None
    for own in flight.vehicles.values():
        own["phase"] = np.zeros(TICKS_S.size)
    assert value_within(flight, "fence_m", 0.0, 10.0) is None
    alone = flown(separation_m=np.full(AT_S.size, math.inf), clearance_m=np.full(AT_S.size, math.nan))
    assert value_within(alone, "min_separation_m", 0.0, 10.0) == math.inf
    assert value_within(alone, "min_clearance_m", 0.0, 10.0) is None
    assert LEADER in alone.vehicles
