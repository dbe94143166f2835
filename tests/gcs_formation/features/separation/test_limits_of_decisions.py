"""Who manoeuvres, from when until when, and what is said of it: limits from both of their sides."""

from __future__ import annotations

import math
from functools import cache
from types import SimpleNamespace
from typing import Any

import numpy as np
import pytest

from airlink.clock import Instant, after
from formation_scenario import load_scenario
from gcs_formation.features.separation.conflict_resolution import Conflict, resolve
from gcs_formation.features.separation.encounters import Encounters
from gcs_formation.features.separation.resolver import ConflictResolver
from tests.flights.conftest import scenario
from tests.gcs_formation.features.separation.crossing import HOVERS, Crossing
from tests.gcs_formation.features.separation.encounters import Vehicles, picture, wanted


def passing(aside_m: float, ahead_m: float = 220.0, **given: Any) -> Any:
    """Return two that meet at 22 m/s each and pass at a distance; to the left it is the mirror image."""
    rows: list[list[float]] = [[0, 0, 100, 22, 0, 0], [ahead_m, aside_m, 100, 22, math.copysign(math.pi, aside_m), 0]]
    vehicles = Vehicles(rows, **given)
    return picture(vehicles, vehicles.state, wanted(vehicles, 0.0))


@pytest.mark.parametrize("sign", [1.0, -1.0])
@pytest.mark.parametrize(
    ("aside_m", "before", "evades"),
    [(10.1, 0.0, False), (10.9, 1.0, True), (11.1, 1.0, False), (10.9, -1.0, True)],
)
def test_a_manoeuvre_ends_beyond_11_m_and_none_begins_beyond_10_m(
    sign: float, aside_m: float, before: float, evades: bool
) -> None:
    """1.1 of the distance that is kept, on the side that was begun with."""
    made = passing(sign * aside_m, 44.0)
    decided = resolve(made, np.array((0.0, before)))
    assert decided.side[0] == 0.0
    assert (decided.side[1] != 0.0) == evades
    if before:
        assert decided.side[1] == (before if evades else 0.0)
    np.testing.assert_array_equal(decided.setpoints.table[:, 0], made.setpoints.table[:, 0])
    assert np.array_equal(decided.setpoints.table, made.setpoints.table) != evades


def test_the_one_that_is_commanded_evades_and_the_later_one_of_two() -> None:
    """Two that meet at 44 m/s from 66 m, after 1.5 s."""
    for commanded, side in (([True, True], [False, True]), ([True, False], [True, False])):
        decided = resolve(passing(3.0, 66.0, commanded=commanded), np.zeros(2))
        assert (decided.side != 0.0).tolist() == side
        (conflict,) = decided.conflicts
        assert (conflict.vehicle, conflict.other) == ((1, 0) if side[1] else (0, 1))
        assert (conflict.nearest_m, conflict.in_s) == pytest.approx((3.0, 1.5))
    neither = resolve(passing(3.0, 66.0, commanded=[False, False]), np.ones(2))
    assert neither.side.tolist() == [0.0, 0.0]
    assert neither.conflicts == ()


def test_who_can_still_evade_later_flies_as_commanded() -> None:
    """From 440 m there are 10 s left, of the 12 s looked ahead."""
    assert not resolve(passing(0.0, 440.0), np.zeros(2)).side.any()


@pytest.mark.parametrize(("side", "height_m"), [(1.0, 111.0), (-1.0, 89.0)])
def test_one_that_evades_goes_on_to_the_side_it_has_begun_with(side: float, height_m: float) -> None:
    """10 m and a margin of 1 m from the other's height, 100 m, within its reach of 12 m."""
    decided = resolve(passing(0.0, 120.0), np.array((0.0, side)))
    assert decided.side.tolist() == [0.0, side]
    assert decided.setpoints.height_m.tolist() == pytest.approx([100.0, height_m])


@pytest.mark.parametrize(
    ("fence_m", "side", "height_m"),
    [((0.0, 112.0), 1.0, 111.0), ((0.0, 110.0), -1.0, 89.0), ((90.0, 110.0), 1.0, 100.0)],
)
def test_the_first_manoeuvre_that_is_left_is_not_flown_where_it_leads_out_of_the_fence(
    fence_m: tuple[float, float], side: float, height_m: float
) -> None:
    """11 m up and then along the other's course comes first; 11 m down is as good, and then to turn as high."""
    decided = resolve(passing(0.0, 94.5, fence_m=fence_m), np.zeros(2))
    assert decided.side.tolist() == [0.0, side]
    assert decided.setpoints.height_m.tolist() == pytest.approx([100.0, height_m])


@pytest.mark.parametrize(("ahead_m", "evades"), [(94.5, True), (95.0, False)])
def test_one_that_can_wait_does_even_if_all_that_it_could_do_later_leads_out_of_the_fence(
    ahead_m: float, evades: bool
) -> None:
    """Below it is the floor: it could climb to 111 m later, and turns as high at last."""
    decided = resolve(passing(0.0, ahead_m, fence_m=(0.0, 105.0), floor_m=95.0), np.zeros(2))
    assert decided.side.any() == evades
    assert decided.setpoints.height_m.tolist() == [100.0, 100.0]


class Meetings:
    """Two and what is logged of them."""

    def __init__(self) -> None:
        self.each = Encounters(load_scenario(scenario(vehicles={"count": 2})))

    def log(
        self,
        at_s: float,
        distance_m: float,
        side: float,
        *conflicts: Conflict,
        height: bool = True,
        known: tuple[int, ...] = (0, 1),
    ) -> list[Any]:
        tick: Any = SimpleNamespace(now=after(Instant(0), at_s), events=[], replaced=[(False, False, height)] * 2)
        position_m = np.array(((0.0, 0.6 * distance_m), (0.0, 0.0), (100.0, 100.0 + 0.8 * distance_m)))
        vehicles = np.array(known, dtype=np.intp)
        traffic = SimpleNamespace(state=SimpleNamespace(position_m=position_m[:, vehicles]))
        made: Any = SimpleNamespace(traffic=traffic, vehicles=vehicles)
        self.each.log_events(tick, made, conflicts, [0.0, side])
        return [(event.text, dict(event.details)) for event in tick.events]


@pytest.mark.parametrize(
    ("side", "height", "how"), [(1.0, True, "upwards"), (-1.0, True, "downwards"), (1.0, False, "as high")]
)
def test_an_encounter_is_reported_with_its_manoeuvre_and_its_least_distance(
    side: float, height: bool, how: str
) -> None:
    meetings, conflict = Meetings(), Conflict(1, 0, 6.25, 4.5)
    assert not meetings.each.any
    details = {"other": "1", "begins": True, "nearest_m": 6.25, "in_s": 4.5}
    text = f"avoids 1, {how}: they would be 6.2 m apart in 4.5 s"
    assert meetings.log(2.0, 40.0, side, conflict, height=height) == [(text, details)]
    assert meetings.each.any
    assert meetings.log(3.0, 12.0, side, conflict) == meetings.log(4.0, 30.0, side, conflict) == []
    details = {"other": "1", "begins": False, "least_m": pytest.approx(12.0), "lasted_s": 5.0}
    assert meetings.log(7.0, 50.0, 0.0) == [("no longer avoids 1: 5.0 s, 12.0 m apart at least", details)]
    assert not meetings.each.any
    assert meetings.log(8.0, 50.0, 0.0) == []


@pytest.mark.parametrize("known", [(0,), (1,), ()])
def test_the_distance_from_one_whose_position_is_not_known_does_not_count(known: tuple[int, ...]) -> None:
    meetings = Meetings()
    meetings.log(2.0, 40.0, 1.0, Conflict(1, 0, 6.0, 4.0))
    assert meetings.log(3.0, 12.0, 1.0, known=known) == []
    ((text, _),) = meetings.log(5.0, 12.0, 0.0, known=known)
    assert text == "no longer avoids 1: 3.0 s, 40.0 m apart at least"


def test_an_encounter_lasts_that_has_for_more_than_half_a_minute() -> None:
    meetings = Meetings()
    meetings.log(0.0, 40.0, 1.0, Conflict(1, 0, 6.0, 4.0))
    assert meetings.log(30.0, 40.0, 1.0) == []
    said = "still avoids 1 after 30 s: it may not get to where it is commanded"
    assert meetings.log(30.1, 40.0, 1.0) == [(said, {"other": "1", "lasted_s": pytest.approx(30.1)})]
    assert meetings.log(61.0, 40.0, 1.0) == []


@cache
def copters() -> ConflictResolver:
    return Crossing(**(HOVERS | {"vehicles": {"count": 3, "model": "arducopter"}})).resolver


def counted(leader: int, **changed: Any) -> tuple[list[int], list[int]]:
    """Return the order of three multirotors with slots 25 m apart, and those that stopped unseen."""
    rule = copters()
    links = [SimpleNamespace(flew=True, brakes=None, airborne=True) for _ in range(3)]
    for name, values in changed.items():
        for link, value in zip(links, values, strict=True):
            setattr(link, name, value)
    errors_m = changed.get("errors_m", [0.0] * 3)
    tick: Any = SimpleNamespace(
        age_s=changed.get("age_s", [0.0] * 3),
        active=changed.get("active", [True] * 3),
        links=links,
        leader=leader,
        error_of=lambda index: (errors_m[index], 0.0, 0.0),
    )
    return rule._members(tick), rule._stopped(tick)


def test_the_leader_comes_first_and_multirotors_far_from_their_slots_last() -> None:
    """10.5 m are kept, less than 0.8 of 25 m."""
    assert counted(0) == ([0, 1, 2], [])
    assert counted(2)[0] == [2, 0, 1]
    assert counted(0, errors_m=[0.0, 10.4, 0.0])[0] == [0, 1, 2]
    assert counted(0, errors_m=[0.0, 10.6, 0.0])[0] == [0, 2, 1]
    assert counted(0, errors_m=[99.0, 10.6, 0.0])[0] == [0, 2, 1]


def test_who_is_not_heard_or_stands_is_not_counted_and_one_that_was_reported_to_stop_is_somewhere() -> None:
    reported = after(Instant(0), 1.0)
    assert counted(0, age_s=[0.0, 29.9, 30.0]) == ([0, 1], [])
    assert counted(0, age_s=[0.0, 29.9, 30.0], brakes=[reported] * 3) == ([0, 1], [2])
    assert counted(0, age_s=[0.0, 29.9, 30.0], brakes=[reported] * 3, airborne=[False] * 3) == ([0, 1], [])
    assert counted(0, active=[True, False, False], flew=[False, False, True])[0] == [0, 2]


@pytest.mark.parametrize(
    ("error_m", "afar"), [((12.0, 12.0, 12.0), False), ((12.2, 12.2, 12.2), True), ((0.0, -21.1, 0.0), True)]
)
def test_one_is_far_from_its_slot_by_twice_the_distance_that_is_kept(
    error_m: tuple[float, float, float], afar: bool
) -> None:
    """10.5 m: 21 m, in space."""
    rule = Crossing().resolver
    tick: Any = SimpleNamespace(error_of=lambda index: error_m if index else (math.nan,) * 3)
    rule._watch_errors(tick)
    assert rule._afar == [False, afar]
    assert np.isnan(rule._slot(1)).all() == afar
    tick.error_of = lambda _: (math.nan,) * 3
    rule._watch_errors(tick)
    assert rule._afar == [False, afar]
