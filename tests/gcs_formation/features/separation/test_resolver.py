"""The distance that is kept: the scenario's, or a share of what its nearest slots leave."""

from __future__ import annotations

import math
import re
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from librt.vecs import vec
from mypy_extensions import i64

from airlink.clock import Instant
from flight_model.slot import UNKNOWN
from flight_model.vehicle_arrays import FlightStates
from formation_scenario import load_scenario
from gcs_formation.estimation.projection import MeasuredStates
from gcs_formation.estimation.setpoint_history import SetpointHistory
from gcs_formation.features.separation.resolver import ConflictResolver
from gcs_formation.from_scenario import autopilot_models
from gcs_formation.recorder import Tick, VehicleLink
from tests.flights.conftest import scenario
from tests.gcs_formation import tables
from tests.gcs_formation.features.separation.crossing import HOVERS, Crossing


@pytest.mark.parametrize(
    ("behind_m", "age_s", "gives"), [(6.0, 0.0, True), (12.0, 0.0, False), (12.0, 2.0, True), (25.0, 2.0, False)]
)
def test_the_older_the_states_the_more_room_for_instants_that_are_off(
    behind_m: float, age_s: float, gives: bool
) -> None:
    """With timing errors of a tenth of 2 s each at 22 m/s, at a right angle, they pass up to 9 m too close."""
    assert Crossing(behind_m).manoeuvres(age_s) is gives


def test_of_two_that_are_commanded_the_one_that_surely_receives_manoeuvres() -> None:
    """Otherwise the later one evades. One that may not hear is commanded, but others avoid it as if it flew on."""
    received, silent = Crossing(), Crossing()
    for each in (received, silent):
        each.ours = np.array((True, True))
        each.north, each.east = np.array((0.0, 0.0)), np.array((0.0, 24.0))
        each.heading[:] = (0.0, -0.5)
    assert received.keep(at_s=10.0).yielding == [False, True]
    silent.received_s = 9.1
    assert silent.keep(at_s=10.0).yielding[0], "requests and their answers are 0.27 s apart where nothing is lost"


@pytest.mark.parametrize(("planned_m", "gives"), [(None, True), (math.inf, True), (13.1, True), (12.0, False)])
def test_slots_that_are_planned_to_come_nearer_on_their_way_are_not_fought(
    planned_m: float | None, gives: bool
) -> None:
    """Two come within 10 m, less than the rule keeps, before the later one flies along with the other."""
    beside = Crossing()
    beside.ours[:] = True
    beside.north[:], beside.east[:], beside.heading[:] = 0.0, (0.0, 16.0), (0.0, -0.2)
    assert any(beside.keep(planned_m=planned_m).yielding) is gives


def test_a_way_planned_beside_anothers_slot_leaves_the_limit_to_be_kept() -> None:
    """A way was planned to begin 1 m from a slot whose own vehicle was elsewhere: others weren't kept apart."""
    meeting = Crossing()
    meeting.ours[:] = True
    meeting.north[:], meeting.east[:], meeting.heading[:] = 0.0, (0.0, 16.0), (0.0, -0.4)
    assert any(meeting.keep(planned_m=1.0).yielding)


@pytest.mark.parametrize(("age_s", "gives"), [(29.9, True), (30.1, False)])
def test_who_has_not_been_heard_for_half_a_minute_is_kept_away_from_no_more(age_s: float, gives: bool) -> None:
    crossing = Crossing()
    crossing.east[1] = 110.0 + 8.0
    assert crossing.manoeuvres(age_s) is gives


@pytest.mark.parametrize("flew", [True, False])
@pytest.mark.parametrize(("speed_mps", "wind_mps"), [(0.0, 0.0), (2.9, 0.0), (1.0, 1.9), (1.0, -2.1)])
def test_what_flew_when_it_was_last_heard_is_kept_away_from_however_slow(
    speed_mps: float, wind_mps: float, flew: bool
) -> None:
    """After 5 s it is right in the way, at its flying height: it hovers there, or stands on a roof."""
    crossing = Crossing()
    crossing.speed[1], crossing.wind_north[1], crossing.flew = speed_mps, wind_mps, flew
    crossing.east[1], crossing.north[1] = 5.0 * speed_mps, -5.0 * wind_mps
    assert crossing.manoeuvres() is flew


def test_how_uncommanded_ones_turn_is_estimated_from_their_headings() -> None:
    """Straight on it would cross; at 0.2 rad/s to the right it turns away before."""
    crossing = Crossing()
    assert crossing.manoeuvres(at_s=0.0)
    crossing.heading[1] += 0.2
    turned = crossing.keep(at_s=1.0)
    assert not turned.yielding[0]
    assert turned.events[0].details["begins"] is False


@pytest.mark.parametrize(
    ("to_side_m", "circling", "gives"), [(-15.0, True, True), (15.0, True, False), (-15.0, False, False)]
)
def test_one_that_is_about_to_circle_turns_right_before_its_headings_show_it(
    to_side_m: float, circling: bool, gives: bool
) -> None:
    beside = Crossing()
    beside.north[:], beside.east[:], beside.heading[:] = 0.0, (0.0, to_side_m), 0.0
    beside.circling = circling
    assert beside.manoeuvres() is gives


def test_one_that_is_about_to_circle_may_fly_straight_on_too() -> None:
    """Straight on it crosses; turning right it would be out of the way before."""
    crossing = Crossing()
    crossing.circling = True
    assert crossing.manoeuvres()


@pytest.mark.parametrize(("commanded_m", "gives"), [(100.0, True), (math.nan, False)])
def test_one_that_is_commanded_to_loiter_higher_climbs_there_as_it_turns(commanded_m: float, gives: bool) -> None:
    """It was assumed to level off, and came within 4.1 m of one beside it."""
    beside = Crossing()
    beside.north[:], beside.east[:], beside.heading[:] = (0.0, 25.0), (0.0, -60.0), 0.0
    beside.circling, beside.height_m, beside.holds_at_m = True, 92.0, commanded_m
    assert beside.manoeuvres() is gives


@pytest.mark.parametrize(("rate_hz", "acts_s"), [(50.0, 0.22), (10.0, 0.3), (2.0, 1.5), (0.5, 3.0)])
def test_a_setpoint_of_a_slow_law_is_reckoned_to_act_although_the_next_ones_are_lost(
    rate_hz: float, acts_s: float
) -> None:
    """With 0.2 s for all rates, bursts of losses brought vehicles with slots 15 m apart within 2 m at 2 Hz."""
    planned = load_scenario(scenario(vehicles={"count": 2}, law={"type": "fuzzy_pid", "rate_hz": rate_hz}))
    resolver = ConflictResolver(planned, SetpointHistory(rate_hz), autopilot_models(planned))
    assert resolver._times_s[1] == pytest.approx(acts_s)


def test_no_vehicle_avoids_a_virtual_leader_nor_it_a_vehicle() -> None:
    followers = [{"id": 1, "role": "follower"}, {"id": 2, "role": "follower"}]
    planned = load_scenario(scenario(vehicles=followers, formation={"shape": "line", "spacing_m": 30}))
    resolver = ConflictResolver(planned, SetpointHistory(planned.law.rate_hz), autopilot_models(planned))
    now, none = Instant(0), np.zeros(3)

    def yielding(north_m: tuple[float, ...], east_m: tuple[float, ...], heading: tuple[float, ...]) -> list[bool]:
        level = np.array(north_m), np.array(east_m), none + 100.0, none
        tick = Tick(now, 0.0, "flying", 0, [VehicleLink(now)] * 3, [0.0] * 3, [0.0] * 3, [True] * 3)
        tick.state = tables.states(FlightStates(*level, none + 22.0, np.array(heading), none, none))
        tick.setpoints = [(each.airspeed_mps, each.heading_rad, each.height_m) for each in tick.state]
        tick.slots_m = [(0.0, 0.0, 0.0), (-30.0, 0.0, 0.0), (-60.0, 0.0, 0.0)]
        resolver.keep(tick, MeasuredStates(tick.state, vec[i64]([now] * 3), tick.active, vec[i64]([now] * 3)))
        return tick.yielding

    nearer = -0.5
    assert yielding((0.0, 0.0, 300.0), (0.0, 24.0, 0.0), (0.0, nearer, 0.0)) == [False, False, False]
    assert any(yielding((300.0, 0.0, 0.0), (0.0, 0.0, 24.0), (0.0, 0.0, nearer)))


def test_an_encounter_is_reported_when_it_begins_and_when_it_ends() -> None:
    crossing = Crossing()
    (begun,) = crossing.keep().events
    assert (str(begun.vehicle), begun.details["other"], begun.details["begins"]) == ("1", "2", True)
    assert begun.details["nearest_m"] == pytest.approx(6.0, abs=0.1)
    assert begun.details["in_s"] == pytest.approx(5.0, abs=0.5)
    assert re.match("avoids 2, (up|down)wards: they would be 6.0 m apart in", begun.text)
    crossing.north[0], crossing.east[1] = -44.0, 44.0
    assert crossing.keep(at_s=3.0).events == []
    crossing.north[0], crossing.east[1] = 300.0, -300.0
    (ended,) = crossing.keep(at_s=20.0).events
    assert ended.text == f"no longer avoids 2: 20.0 s, {44.0 * math.sqrt(2.0):.1f} m apart at least"
    assert ended.details["lasted_s"] == pytest.approx(20.0)
    assert ended.details["begins"] is False
    assert crossing.keep(at_s=20.1).events == []


def test_an_encounter_that_does_not_end_is_reported_once() -> None:
    crossing = Crossing()
    texts = [each.text for at_s in (0.0, 29.0, 31.0, 40.0) for each in crossing.keep(at_s=at_s).events]
    assert texts[1:] == ["still avoids 2 after 31 s: it may not get to where it is commanded"]


def beside_each_other(slots_m: float, **keys: Any) -> Crossing:
    """Return two vehicles on parallel courses, 7 m apart, with slots `slots_m` apart."""
    beside = Crossing(**keys)
    beside.ours[:], beside.slots_m = True, [UNKNOWN, (0.0, slots_m, 0.0)]
    beside.north[:], beside.east[:], beside.heading[:] = 0.0, (0.0, 7.0), 0.0
    return beside


@pytest.mark.parametrize(("slots_m", "gives"), [(8.0, False), (8.7, False), (8.8, True), (30.0, True)])
def test_two_whose_slots_are_near_each_other_are_not_fought(slots_m: float, gives: bool) -> None:
    """They keep 0.8 of what their slots leave; otherwise 10 m by the rule, plus 0.5 m for uncertainty."""
    assert any(beside_each_other(slots_m).keep().yielding) is gives


def test_slots_that_are_near_each_other_at_another_time_lower_nothing() -> None:
    narrow = {"shape": "line", "spacing_m": 30, "changes": [{"at_s": 9, "spacing_m": 6}]}
    assert any(beside_each_other(30.0, formation=narrow).keep().yielding)
    beside = beside_each_other(8.0)
    assert not any(beside.keep().yielding)
    beside.slots_m = [UNKNOWN, (0.0, 30.0, 0.0)]
    assert any(beside.keep(at_s=0.1).yielding)


def test_slots_that_only_happen_to_be_near_each_other_leave_the_limit_to_be_kept() -> None:
    """Slots of vehicles that gather beside the leader are where the vehicles were found."""
    beside = beside_each_other(4.0)
    beside.east[:] = 0.0, 4.5
    assert not any(beside.keep().yielding)
    assert any(beside.keep(at_s=0.1, planned_m=math.inf).yielding)


def test_who_comes_from_afar_keeps_the_whole_distance_also_while_slots_change() -> None:
    """Distances on planned ways apply to vehicles in their slots only: it had passed one within 2.7 m."""
    beside = beside_each_other(8.0)
    assert not any(beside.keep(planned_m=8.0).yielding)
    beside.error_m = [UNKNOWN, (22.0, 0.0, 0.0)]
    assert any(beside.keep(at_s=0.1, planned_m=8.0).yielding)


def test_while_slots_change_two_keep_what_their_own_ways_leave() -> None:
    """What others' ways leave doesn't reduce the distance, neither in the quick check nor later."""
    near_m = np.full((3, 3), 30.0)
    near_m[0, 2] = near_m[2, 0] = 6.0
    resolver = Crossing(vehicles={"count": 3}).resolver
    kept = resolver.kept_while_moving(near_m)
    assert kept.each_m is not None
    assert (kept.rows[0][2], kept.rows[0][1], kept.rows[1][2]) == (5.5, 10.5, 10.5)
    assert kept.rows == kept.each_m.tolist()
    assert resolver.kept_while_moving(near_m) is kept


@pytest.mark.parametrize(("planned_m", "kept_m"), [(0.0, 5.5), (6.2, 5.7), (9.0, 7.2), (13.0, 10.4), (14.0, 10.5)])
def test_ways_that_are_planned_nearer_leave_the_limit_and_half_a_metre(planned_m: float, kept_m: float) -> None:
    """Up to 1 m beyond the limit, as near as planned less 0.5 m; then 0.8 of it; never more than elsewhere."""
    kept = Crossing(safety={"separation_m": 5}).resolver.kept_while_moving(np.full((2, 2), planned_m))
    assert kept.rows[0][1] == pytest.approx(kept_m)


def test_two_that_drift_together_in_winds_of_their_own_are_seen_while_they_are_still_apart() -> None:
    """The one ahead is 13 m away, and its wind takes 2 m/s from it."""
    behind = Crossing()
    behind.ours[:] = True
    behind.north[:], behind.east[:], behind.heading[:] = (0.0, 13.0), 0.0, 0.0
    assert not any(behind.keep().yielding)
    behind.wind_north[1] = -2.0
    assert any(behind.keep(at_s=0.1).yielding)


def test_who_comes_to_its_slot_from_afar_is_near_no_vehicle_and_stays_so_where_slots_are_left() -> None:
    """Beside a column with slots 6 m apart, one that caught up passed at 3.0 m as the flight ended."""
    beside = beside_each_other(8.0)
    beside.error_m = [UNKNOWN, (20.0, 0.0, 0.0)]
    assert not any(beside.keep().yielding)
    beside.error_m = [UNKNOWN, (22.0, 0.0, 0.0)]
    assert any(beside.keep(at_s=0.1).yielding)
    beside.error_m = [UNKNOWN, UNKNOWN]
    assert any(beside.keep(at_s=0.2).yielding)


def test_where_slots_are_left_at_the_end_those_that_were_count_on() -> None:
    beside = beside_each_other(8.0)
    beside.keep()
    beside.slots_m = [UNKNOWN, UNKNOWN]
    assert not any(beside.keep(at_s=0.1).yielding)


def column_of_copters() -> Crossing:
    """The second flies 25 m ahead of the first, both at 8 m/s."""
    index = Crossing(**HOVERS)
    index.ours[:], index.slots_m = True, [UNKNOWN, (25.0, 0.0, 0.0)]
    index.north[:], index.east[:], index.heading[:], index.speed[:] = (0.0, 25.0), 0.0, 0.0, 8.0
    return index


@pytest.mark.parametrize(
    ("hovers_after_s", "silent_s", "gives"), [(3.0, 2.4, False), (3.0, 2.6, True), (math.inf, 9.0, False)]
)
def test_one_that_receives_nothing_any_more_may_hover_where_it_is_that_kind(
    hovers_after_s: float, silent_s: float, gives: bool
) -> None:
    """An ArduCopter stops 3 s after its last setpoint (GUID_TIMEOUT); those behind flew into it."""
    index = column_of_copters()
    index.hovers_after_s = hovers_after_s
    for at_s in (10.0, 10.1):
        index.keep(at_s=at_s)
    index.received_s = 10.1
    assert index.keep(at_s=10.1 + silent_s).yielding[0] is gives


def standing_column(home_m: tuple[float, float] | None) -> Crossing:
    """The same, hovering; the second has received nothing since 10.1 s, stops at 11.1 s and leaves by 16.1 s."""
    index = column_of_copters()
    index.hovers_after_s, index.returns_after_s, index.home_m = 1.0, 6.0, home_m
    index.commanded_mps, index.speed[:] = 0.0, 0.0
    for at_s in (10.0, 10.1):
        index.keep(at_s=at_s)
    index.received_s = 10.1
    return index


@pytest.mark.parametrize(("home_m", "gives"), [(None, False), ((400.0, 0.0), False), ((-400.0, 0.0), True)])
def test_one_that_receives_nothing_any_more_may_have_set_off_for_home(
    home_m: tuple[float, float] | None, gives: bool
) -> None:
    """A PX4 has left by 6 s after its last setpoint, unseen: it came back through those behind it at 2.1 m."""
    assert standing_column(home_m).keep(at_s=12.1).yielding[0] is gives


def test_one_that_is_seen_to_stand_longer_than_failsafes_wait_stays_there() -> None:
    index = standing_column((-400.0, 0.0))
    assert index.keep(at_s=16.0).yielding[0]
    index = standing_column((-400.0, 0.0))
    assert not index.keep(at_s=16.3).yielding[0]


@pytest.mark.parametrize(("at_s", "gives"), [(25.0, True), (29.0, False)])
def test_one_that_is_not_seen_either_is_home_by_and_by(at_s: float, gives: bool) -> None:
    """It sets out at 16.1 s at the latest, and flies 35 m in 12 s."""
    index = standing_column((-10.0, 0.0))
    index.seen_s = 10.1
    assert index.keep(at_s=at_s).yielding[0] is gives


def test_a_multirotor_that_brakes_though_it_is_commanded_to_fly_on_is_kept_clear_of_until_it_comes_back() -> None:
    index, gives = column_of_copters(), list[bool]()
    for tick in range(60):
        if 20 <= tick < 40:
            index.speed[1] = max(index.speed[1] - 0.25, 0.0)
        elif tick >= 40:
            index.speed[1] = min(index.speed[1] + 0.25, 8.0)
        index.commanded_mps = 8.0
        gives.append(index.keep(at_s=10.0 + 0.1 * tick).yielding[0])
    assert not any(gives[:24])
    assert all(gives[30:40])


def floor_m(keys: dict[str, Any], north_m: float, wind_east_mps: float = 0.0) -> float:
    """Return the lowest height for a vehicle that flies northwards at 22 m/s, 100 m high."""
    planned = load_scenario(scenario(**keys))
    resolver = ConflictResolver(planned, SetpointHistory(planned.law.rate_hz), autopilot_models(planned))
    values = north_m, 0.0, 100.0, 0.0, 22.0, 0.0, 0.0, wind_east_mps
    return float(resolver._floor_m(FlightStates.of(np.array([values]).T))[0])


def test_who_is_sent_down_is_clear_of_ground_that_the_wind_takes_it_over() -> None:
    """Within 12 s it moves 264 m north, where a hill of 40 m is 120 m to the east.

    Places are sampled a few metres apart.
    """
    hill = {"north_m": 264, "east_m": 120, "height_m": 40, "radius_m": 20}
    keys = {"terrain": {"hills": [hill], "clearance_m": 20}, "safety": {"clearance_m": 5, "separation_m": 5}}
    assert floor_m(keys, 0.0) == pytest.approx(5.0 + 10.0, abs=0.1)
    assert floor_m(keys, 0.0, wind_east_mps=10.0) == pytest.approx(40.0 + 5.0 + 10.0, abs=2.0)


def test_over_ground_that_is_not_known_no_vehicle_is_sent_down_and_any_may_be_sent_up(tmp_path: Path) -> None:
    """The tile's values end 1112 m north of the origin."""
    heights_m = np.full((1201, 1201), 30, dtype=">i2")
    heights_m[:599] = -32768
    heights_m.tofile(tmp_path / "N35E125.hgt")
    keys = {
        "terrain": {"file": str(tmp_path / "N35E125.hgt")},
        "origin": {"lat_deg": 35.49, "lon_deg": 125.5},
        "start": {"in_air": True},
        "path": {"waypoints_m": [[0, 0, 100], [900, 0, 100]]},
    }
    assert floor_m(keys, 0.0) == pytest.approx(30.0 + 5.0 + 10.0)
    assert floor_m(keys, 1000.0) == 100.0
