"""How far the leader and the formation's centre are from the path, of flights of which that is known."""

from __future__ import annotations

import math

import numpy as np
import pytest

from airlink.endpoint import VehicleId
from flight_model.arrays import Array
from formation_scenario import Scenario, load_scenario
from gcs_formation.record.limits_by_truth import Track
from gcs_formation.record.path_distance import (
    FIGURES,
    OFF_PATH_S,
    Distances,
    centre,
    distances,
    figures,
    leader_position_m,
    off_path,
    path_distances,
    unknown,
)
from gcs_formation.record.timeseries import PHASES, POSITION, VIRTUAL_LEADER

SPEED_MPS = 20.0
SCENARIO = load_scenario(
    {
        "vehicles": {"count": 3},
        "path": {"speed_mps": SPEED_MPS, "waypoints_m": [[0, 0, 100], [1500, 0, 100], [2000, 900, 130]]},
        "safety": {"path_distance_m": 15},
    }
)
STRAIGHT = load_scenario(
    {
        "vehicles": {"count": 2},
        "path": {"speed_mps": SPEED_MPS, "waypoints_m": [[0, 0, 100], [4000, 0, 100]]},
        "safety": {"path_distance_m": 15},
    }
)
MISSION_S = np.arange(0.0, 120.0, 0.5)


def flown(
    right_m: Array | float, ahead_m: float = 0.0, up_m: float = 0.0, scenario: Scenario = SCENARIO
) -> tuple[Array, Array, Array]:
    """Return mission times and places (3, N) beside the path, ahead of the plan, and the path's courses there."""
    point = scenario.leader_path.at(SPEED_MPS * MISSION_S + ahead_m)
    north_m, east_m = (
        point.north_m - right_m * np.sin(point.course_rad),
        point.east_m + right_m * np.cos(point.course_rad),
    )
    return MISSION_S, np.stack((north_m, east_m, point.height_m + up_m)), point.course_rad


@pytest.mark.parametrize(("right_m", "ahead_m", "up_m"), [(0.0, 0.0, 0.0), (12.0, -5.0, 3.0), (-25.0, 8.0, -4.0)])
def test_distances_are_those_from_the_nearest_point_and_from_where_it_was_due(
    right_m: float, ahead_m: float, up_m: float
) -> None:
    mission_s, place, course_rad = flown(right_m, ahead_m, up_m)
    assert np.ptp(course_rad) > math.radians(50.0), "it bends"
    place[:, 7] = np.nan
    found = distances(SCENARIO, mission_s, place)
    known = np.arange(mission_s.size) != 7
    for values, expected in zip(found, (right_m, ahead_m, up_m), strict=True):
        assert np.isnan(values[7])
        np.testing.assert_allclose(values[known], expected, atol=0.01)
    assert figures(found, known)["across_m"] == pytest.approx({"rms": abs(right_m), "max": abs(right_m)}, abs=0.01)


def test_of_places_that_none_knows_there_are_no_distances() -> None:
    found = distances(SCENARIO, MISSION_S, np.full((3, MISSION_S.size), np.nan))
    assert np.isnan(found).all()
    assert figures(found, np.ones(MISSION_S.size, dtype=bool))["along_m"] == {"rms": None, "max": None}


@pytest.mark.parametrize("number", [0, 7, -1])
def test_one_place_that_is_known_has_its_distances(number: int) -> None:
    mission_s, place, _ = flown(12.0, -5.0, 3.0)
    found = distances(SCENARIO, mission_s[[number]], place[:, [number]])
    np.testing.assert_allclose(np.array(found)[:, 0], (12.0, -5.0, 3.0), atol=0.01)


@pytest.mark.parametrize(("seconds", "found"), [(OFF_PATH_S - 1.0, False), (OFF_PATH_S + 1.0, True)])
def test_a_leader_is_off_its_path_that_is_too_far_from_it_for_too_long(seconds: float, found: bool) -> None:
    since_s = MISSION_S - 40.0
    away = (since_s >= 0.0) & (since_s <= seconds)
    mission_s, place, _ = flown(np.where(away, 16.0, 14.0))
    place[2, MISSION_S == 45.0] += 12.0
    (*each,) = off_path(SCENARIO, Track(mission_s, place, np.zeros(mission_s.size, dtype=int)))
    assert bool(each) == found
    if found:
        assert (each[0].vehicle, each[0].from_s, each[0].farthest_at_s) == (0, 40.0, 45.0)
        assert each[0].for_s == pytest.approx(seconds)
        assert each[0].farthest_m == pytest.approx(20.0, abs=0.01), "3-4-5: 16 m beside and 12 m above"


def test_one_that_begins_to_lead_off_the_path_may_be_as_much_farther_away_as_it_is() -> None:
    """From 20 m beside it, up to 35 m; once it was within 15 m, no farther than that."""
    after = MISSION_S >= 60.0
    mission_s, place, _ = flown(np.where(after, 10.0, 34.0) + np.where(MISSION_S == 0.0, -14.0, 0.0))
    leads = np.zeros(mission_s.size, dtype=int)
    assert list(off_path(SCENARIO, Track(mission_s, place, leads))) == []
    mission_s, place, _ = flown(np.where(after, 10.0, 36.0) + np.where(MISSION_S == 0.0, -16.0, 0.0))
    assert [each.from_s for each in off_path(SCENARIO, Track(mission_s, place, leads))] == [0.5]
    mission_s, place, _ = flown(np.where(after, 34.0, 10.0))
    (one,) = off_path(SCENARIO, Track(mission_s, place, leads))
    assert one.from_s == 60.0
    leads[after] = 1
    assert list(off_path(SCENARIO, Track(mission_s, place, leads))) == [], "another begins to lead there"


def test_the_centre_is_the_mean_of_its_members_places_less_their_slots() -> None:
    """All head east. One follower is 3 m behind its slot and 6 m above; another isn't commanded, one isn't aloft."""
    ticks = 3
    leader = {"leads": 1.0, "active": 1.0, "airborne": 1.0, "north_m": 100.0, "east_m": 50.0, "height_m": 80.0}
    behind = leader | {"leads": 0.0, "north_m": 80.0, "east_m": 17.0, "height_m": 91.0}
    behind |= {"slot_forward_m": -30.0, "slot_right_m": 20.0, "slot_up_m": 5.0}
    absent = behind | {"north_m": 0.0, "active": 0.0}
    grounded = behind | {"height_m": 0.0, "airborne": 0.0}
    vehicles = {
        VehicleId(0, number): {
            name: np.full(ticks, value)
            for name, value in ({"slot_forward_m": np.nan, "slot_right_m": np.nan, "slot_up_m": np.nan} | own).items()
        }
        | {"t_s": np.arange(ticks) / 10.0, "heading_rad": np.full(ticks, math.pi / 2)}
        for number, own in enumerate((leader, behind, absent, grounded), 1)
    }
    found = centre(SCENARIO, vehicles)
    np.testing.assert_allclose(found, np.tile([[100.0], [48.5], [83.0]], ticks))


@pytest.mark.parametrize(("at_s", "ahead_m"), [(60.0, 0.0), (99.0, 0.0), (110.0, 40.0)])
def test_a_speed_ordered_before_the_path_is_that_of_its_start(at_s: float, ahead_m: float) -> None:
    """The path begins at 100 s and is flown at 24 m/s; 4 m/s faster than planned for 10 s is 40 m."""
    begun_s, speed_mps, mission_s = 100.0, SPEED_MPS + 4.0, np.arange(20.0, 40.0)
    columns = {"slot_forward_m": np.nan, "slot_right_m": np.nan, "slot_up_m": np.nan, "heading_rad": math.pi / 2}
    columns |= {"leads": 1.0, "active": 1.0, "airborne": 1.0, "phase": PHASES.index("flying")}
    leader = {name: np.full(mission_s.size, value) for name, value in columns.items()}
    point = SCENARIO.leader_path.at(speed_mps * mission_s)
    leader |= {"t_s": begun_s + mission_s, "mission_time_s": mission_s}
    leader |= {"north_m": point.north_m, "east_m": point.east_m, "height_m": point.height_m}
    found = path_distances(SCENARIO, {VehicleId(1, 1): leader}, [(at_s, speed_mps)])
    np.testing.assert_allclose(found["leader"].along_m, ahead_m, atol=0.01)


def test_after_an_interruption_the_nearest_point_is_found_ahead() -> None:
    """Half a minute isn't known, in which the leader flew 600 m on; before the first place, too."""
    mission_s, place, _ = flown(7.0)
    gone = ((mission_s > 20.0) & (mission_s < 50.0)) | (mission_s < 8.0)
    place[:, gone] = np.nan
    found = distances(SCENARIO, mission_s, place)
    np.testing.assert_allclose(found.across_m[~gone], 7.0, atol=0.01)
    np.testing.assert_allclose(found.along_m[~gone], 0.0, atol=0.01)
    assert np.isnan(found.across_m[gone]).all()


def test_places_are_followed_along_a_path_that_comes_near_itself_again() -> None:
    """A leg northwards, and 10 m beside it the same way back: after the turn, distances are from the second leg."""
    legs = [[0, 0, 100], [1500, 0, 100], [1900, 300, 100], [1500, 600, 100], [900, 10, 100], [0, 10, 100]]
    scenario = load_scenario(
        {"vehicles": {"count": 2}, "path": {"speed_mps": SPEED_MPS, "waypoints_m": legs}}, flown=True
    )
    length_m = scenario.leader_path.length_m
    along_m = np.arange(0.0, length_m - 20.0, 10.0)
    point = scenario.leader_path.at(along_m)
    found = distances(scenario, along_m / SPEED_MPS, np.stack((point.north_m, point.east_m, point.height_m)))
    for values in found:
        np.testing.assert_allclose(values, 0.0, atol=0.05)


@pytest.mark.parametrize(("seconds", "off"), [(9.5, False), (10.0, True), (10.5, True)])
@pytest.mark.parametrize("beyond_m", [0.0, 1e-3])
def test_off_its_path_is_farther_than_the_bound_for_10_s_or_more(seconds: float, beyond_m: float, *, off: bool) -> None:
    """Two such times are told one by one, each with its own farthest; one that lasts to the end too."""
    away = np.zeros(MISSION_S.size)
    for begin_s in (20.0, 60.0, 119.5 - seconds):
        since_s = MISSION_S - begin_s
        away += (since_s >= 0.0) & (since_s <= seconds)
    north_m = SPEED_MPS * MISSION_S
    place = np.stack((north_m, (15.0 + beyond_m) * away, np.full(north_m.size, 100.0)))
    found = list(off_path(STRAIGHT, Track(MISSION_S, place, np.full(MISSION_S.size, 2))))
    assert [(each.vehicle, each.from_s, each.for_s) for each in found] == (
        [(2, begin_s, seconds) for begin_s in (20.0, 60.0, 119.5 - seconds)] if off and beyond_m else []
    )


def test_a_leader_is_off_as_planned_while_steps_are_added_to_its_setpoints() -> None:
    """From 20 s to 40 s; what is left of the time before and after doesn't last for 10 s."""
    keys = {"vehicles": {"count": 2}, "safety": {"path_distance_m": 15}}
    path = {"speed_mps": SPEED_MPS, "waypoints_m": [[0, 0, 100], [4000, 0, 100]]}
    steps = [{"at_s": 20, "for_s": 20, "height_m": 30}]
    place = np.stack((SPEED_MPS * MISSION_S, np.zeros(MISSION_S.size), np.full(MISSION_S.size, 130.0)))
    place[2, (MISSION_S < 12.0) | (MISSION_S > 48.0)] = 100.0
    for own, off in ((path, True), (path | {"steps": steps}, False)):
        scenario = load_scenario(keys | {"path": own}, flown=True)
        found = list(off_path(scenario, Track(MISSION_S, place, np.zeros(MISSION_S.size, dtype=int))))
        assert [each.for_s for each in found] == [36.0] * off


@pytest.mark.parametrize(("gap_s", "again"), [(0.5, False), (1.0, False), (1.5, True)])
def test_a_leader_that_was_out_of_sight_for_more_than_a_second_begins_anew(gap_s: float, *, again: bool) -> None:
    """It comes back 26 m beside the path, which is as far as it may be until it has come near."""
    time_s = np.arange(0.0, 60.0, 0.25)
    away_m = np.where(time_s >= 30.0, 26.0, 0.0)
    place = np.stack((SPEED_MPS * time_s, away_m, np.full(time_s.size, 100.0)))
    place[:, (time_s > 30.0 - gap_s) & (time_s < 30.0)] = np.nan
    found = list(off_path(STRAIGHT, Track(time_s, place, np.zeros(time_s.size, dtype=int))))
    assert bool(found) is not again


def test_figures_are_of_the_known_distances_in_the_window() -> None:
    values = np.array([3.0, -4.0, np.nan, 100.0])
    found = figures(Distances(values, -values, 2.0 * values), np.array([True, True, True, False]))
    assert found["across_m"] == {"rms": pytest.approx(np.sqrt(12.5)), "max": 4.0}
    assert found["along_m"] == {"rms": pytest.approx(np.sqrt(12.5)), "max": 4.0}
    assert found["height_m"] == {"rms": pytest.approx(2.0 * np.sqrt(12.5)), "max": 8.0}
    assert unknown() == {who: {name: {"rms": None, "max": None} for name in FIGURES} for who in ("leader", "centre")}


def row(**values: float) -> dict[str, Array]:
    """Return the columns of one vehicle at one tick, commanded and in flight at the origin."""
    plain = {"t_s": 0.0, "north_m": 0.0, "east_m": 0.0, "height_m": 100.0, "heading_rad": 0.0, "leads": 0.0}
    plain |= {"active": 1.0, "airborne": 1.0, "slot_forward_m": 0.0, "slot_right_m": 0.0, "slot_up_m": 0.0}
    return {name: np.array([value]) for name, value in (plain | values).items()}


def test_the_centre_behind_a_virtual_leader_turns_slots_by_its_heading() -> None:
    """It heads east, and is none of the members. One is 30 m behind its place; true places and headings come first."""
    virtual = dict(zip(VIRTUAL_LEADER, (500.0, 0.0, 100.0, math.pi / 2), strict=True))
    one = row(north_m=-10.0, east_m=20.0, slot_forward_m=20.0, slot_right_m=10.0, **virtual)
    other = row(east_m=-30.0, height_m=106.0, slot_up_m=2.0, **virtual)
    vehicles = {VehicleId(1, 1): one, VehicleId(1, 2): other}
    np.testing.assert_allclose(centre(SCENARIO, vehicles), [[0.0], [-15.0], [102.0]], atol=1e-9)
    np.testing.assert_allclose(leader_position_m(vehicles, POSITION), [[500.0], [0.0], [100.0]])
    seen = {
        vehicle: own | {f"true_{name}": own[name] + 1.0 for name in POSITION} | {"true_heading_rad": own["heading_rad"]}
        for vehicle, own in vehicles.items()
    }
    np.testing.assert_allclose(centre(SCENARIO, seen), [[1.0], [-14.0], [103.0]], atol=1e-9)
    grounded = {vehicle: own | {"airborne": np.zeros(1)} for vehicle, own in vehicles.items()}
    assert np.isnan(centre(SCENARIO, grounded)).all()


@pytest.mark.parametrize("leader", [0, 1, 2])
def test_the_centre_turns_slots_by_the_heading_of_whoever_leads(leader: int) -> None:
    """It heads east at the origin; the others, 20 m behind it and 10 m to its right, head otherwise."""
    each = [row(north_m=-10.0, east_m=-20.0, slot_forward_m=-20.0, slot_right_m=10.0, heading_rad=2.5) for _ in "abc"]
    each[leader] = row(leads=1.0, heading_rad=math.pi / 2, slot_forward_m=math.nan)
    vehicles = {VehicleId(1, number): own for number, own in enumerate(each, 1)}
    np.testing.assert_allclose(centre(SCENARIO, vehicles), [[0.0], [0.0], [100.0]], atol=1e-9)


def test_the_leaders_place_is_its_own_in_flight() -> None:
    vehicles = {VehicleId(1, 1): row(north_m=5.0), VehicleId(1, 2): row(north_m=7.0, east_m=8.0, leads=1.0)}
    np.testing.assert_array_equal(leader_position_m(vehicles, POSITION), [[7.0], [8.0], [100.0]])
    vehicles[VehicleId(1, 2)]["airborne"] = np.zeros(1)
    assert np.isnan(leader_position_m(vehicles, POSITION)).all()
