"""A crashed vehicle isn't part of the formation, by ground truth or as far as the station knew."""

import numpy as np
import pytest

from airlink.endpoint import VehicleId
from formation_scenario import load_scenario
from gcs_formation.record.expectations import judge
from gcs_formation.record.figures_of_merit import clearance_m, minimum, of_follower, separation_m
from gcs_formation.record.flight import SCORED, FlightBuilder, judged, split, tables
from gcs_formation.record.timeseries import MEASURED, PHASES, VIRTUAL_LEADER

LEADER, FOLLOWER, THIRD = (VehicleId(1, system) for system in (1, 2, 3))
TIME_S = np.arange(0.0, 10.01, 0.1)
CRASH_S = 4.02
"""Between two ticks, and between two rows of the truth."""
KEYS = {"vehicles": {"count": 3}, "duration_s": 10, "path": {"waypoints_m": [[0, 0, 100], [4000, 0, 100]]}}
SCENARIO = load_scenario(KEYS)


def spool(*, station_airborne=None, handed_over_s=np.inf, heir=FOLLOWER):
    """Return the station's columns of three vehicles in a row, 30 m apart, at 22 m/s, each in its slot.

    From `handed_over_s` on `heir` leads.
    """
    parts, leader = [], np.where(handed_over_s <= TIME_S, heir.system - 1, 0)
    for index in range(3):
        slot_m = 30.0 * (leader - index)
        own = {name: np.zeros(TIME_S.size) for name in MEASURED} | {
            "network": np.ones(TIME_S.size),
            "vehicle": np.full(TIME_S.size, index + 1),
            "phase": np.full(TIME_S.size, PHASES.index("flying")),
            "mission_time_s": TIME_S,
            "t_s": TIME_S,
            "north_m": 22.0 * TIME_S - 30.0 * index,
            "height_m": np.full(TIME_S.size, 100.0),
            "active": np.ones(TIME_S.size),
            "leads": leader == index,
            "slot_forward_m": np.where(leader == index, np.nan, slot_m),
            "airborne": np.ones(TIME_S.size),
        }
        if station_airborne is not None and index == 2:
            own["airborne"] = station_airborne.astype(float)
        parts.append(own)
    return {name: np.stack([part[name] for part in parts], axis=1).ravel() for name in parts[0]}


def truth(*crashed):
    """Return the truth of the same flight at 25 Hz; `crashed` vehicles fall at `CRASH_S` and stay on the ground."""
    time_s = np.arange(0.0, 10.01, 0.04)
    flying, nothing = np.ones((time_s.size, 3)), np.zeros((time_s.size, 3))
    north_m = 22.0 * time_s[:, None] - np.array([0.0, 30.0, 60.0])
    for each in crashed:
        after, column = time_s >= CRASH_S, each.system - 1
        flying[after, column] = 0.0
        north_m[after, column] = north_m[~after, column][-1]
    return {
        "time_s": time_s,
        "north_m": north_m,
        "east_m": nothing,
        "height_m": 100.0 * flying,
        "north_mps": 22.0 * flying,
        "east_mps": nothing,
        "climb_mps": nothing,
        "airspeed_mps": 22.0 * flying,
        "heading_rad": nothing,
        "disturbance_north_mps": nothing,
        "disturbance_east_mps": nothing,
        "disturbance_down_mps": nothing,
        "airborne": flying,
    }


def recorded(rows, true=None):
    """Return the flight from a spool's columns and the truth."""
    injected, read = dict.fromkeys((LEADER, FOLLOWER, THIRD), np.zeros((TIME_S.size, 2))), true and (lambda *_: true)
    (whole,) = tables([rows], SCENARIO, read, injected)
    return judged(split(whole, SCENARIO), SCENARIO, read)


def flown(*crashed, third_leads_from_s=np.inf):
    return recorded(spool(handed_over_s=third_leads_from_s, heir=THIRD), truth(*crashed))


WHOLE = np.ones(TIME_S.size, dtype=bool)


def test_a_wreck_counts_neither_in_clearance_nor_in_separation():
    flight = flown(FOLLOWER)
    assert flight.vehicles[FOLLOWER]["true_height_m"].min() == 0.0
    assert clearance_m(flight, WHOLE) == pytest.approx(100.0)
    distance_m = separation_m(flight, WHOLE)
    assert distance_m[TIME_S < CRASH_S] == pytest.approx(30.0)
    assert distance_m[TIME_S > CRASH_S + 0.1] == pytest.approx(60.0)


def test_it_is_out_from_the_first_tick_after_and_no_place_on_its_way_down_counts():
    assert flown(THIRD).airborne(THIRD).tolist() == (TIME_S < CRASH_S).tolist()


def test_a_wreck_has_no_error_and_the_others_keep_theirs():
    flight = flown(THIRD)
    known = np.isfinite(flight.error(THIRD)).all(axis=1)
    assert known.tolist() == (TIME_S < CRASH_S).tolist()
    assert np.abs(flight.error(FOLLOWER)).max() < 1e-9


def test_no_vehicle_has_an_error_behind_a_leader_that_is_dead():
    flight = flown(LEADER)
    for follower in (FOLLOWER, THIRD):
        known = np.isfinite(flight.error(follower)).all(axis=1)
        assert known.tolist() == (TIME_S < CRASH_S).tolist()


def test_without_truth_the_station_s_knowledge_decides():
    airborne = TIME_S < 6.0
    flight = recorded(spool(station_airborne=airborne))
    assert np.isfinite(flight.error(THIRD)).all(axis=1).tolist() == airborne.tolist()
    assert np.isfinite(flight.clearance(THIRD)).tolist() == airborne.tolist()


def test_expectations_are_of_any_vehicle_that_follows_in_their_window():
    """The second vehicle leads from 5 s on, so expectations of later followers concern the first vehicle, not it.

    Over a window of which each of them followed for half, neither is judged.
    """
    flight = recorded(spool(handed_over_s=5.0), truth())
    windows = [{"from_s": 0, "to_s": 4}, {"from_s": 6, "to_s": 10}, {"from_s": 0, "to_s": 10}]
    expect = [{"metric": "error_x_m.max", "below": 0.1, **window} for window in windows]
    scenario = load_scenario(KEYS | {"expect": expect})
    parts = {"duration_s": 10.0, "followers": {str(system): {"settled_at_s": None} for system in (1, 2, 3)}}
    verdicts = list(judge(scenario, flight, parts, {}, cut_short=False))
    assert str(verdicts[0]).endswith("not judged: led all the time")
    held = [(str(each.vehicle), each.held) for each in verdicts]
    assert held[:3] == [("1", None), ("2", True), ("3", True)]
    assert held[3:6] == [("1", True), ("2", None), ("3", True)]
    assert held[6:] == [("1", None), ("2", None), ("3", True)]
    assert [round(each.share, 2) for each in verdicts[6:]] == [0.5, 0.5, 1.0]
    assert str(verdicts[6]).endswith("not judged: led for 5.0 s")


def test_figures_of_one_that_led_say_of_what_share_of_the_time_they_are() -> None:
    """It is in its slot whenever it follows, 0.3 s of 10."""
    flight = recorded(spool(handed_over_s=0.3), truth())
    figures = [of_follower(flight, each, flight.window(0.0, 10.0), 0.0) for each in (FOLLOWER, THIRD)]
    assert [each["in_slot_share"] for each in figures] == [1.0, 1.0]
    assert [each["followed_share"] for each in figures] == [pytest.approx(3 / 101), 1.0]


@pytest.mark.parametrize("ticks", [1, 7, 100, 101])
def test_a_flight_that_passes_in_blocks_is_the_same(ticks):
    rows, true = spool(), truth(THIRD)
    rng = np.random.default_rng(ticks)
    injected = {each: rng.random((TIME_S.size, 2)) for each in (LEADER, FOLLOWER, THIRD)}
    blocks = [{name: each[at : at + 3 * ticks] for name, each in rows.items()} for at in range(0, 303, 3 * ticks)]
    building = FlightBuilder(SCENARIO)
    passed = list(building.passing(tables(blocks, SCENARIO, lambda *_: true, injected)))
    assert [len(each["t_s"]) for each in passed[:-1]] == [ticks] * (len(blocks) - 1)
    whole = split(next(tables([rows], SCENARIO, lambda *_: true, injected)), SCENARIO)
    flight = building.flight()
    assert set(flight.vehicles[THIRD]) == SCORED - set(VIRTUAL_LEADER)
    for name in flight.vehicles[THIRD]:
        np.testing.assert_array_equal(flight.vehicles[THIRD][name], whole.vehicles[THIRD][name])
    ways_s = np.concatenate([each["injected_up_s"] for each in passed])
    np.testing.assert_array_equal(ways_s[:, 2], injected[THIRD][:, 0])


def test_vehicles_of_two_networks_with_the_same_number_keep_their_rows_in_whatever_order_they_were_recorded():
    scenario = load_scenario(
        KEYS | {"vehicles": [{"network": 2, "id": 1, "role": "leader"}, {"id": 1, "role": "follower"}]}
    )
    for networks in ([1, 2], [2, 1]):
        rows = {name: np.zeros(4) for name in MEASURED} | {"phase": np.zeros(4), "vehicle": np.ones(4)}
        rows |= {"network": np.tile(networks, 2), "north_m": 100.0 * np.tile(networks, 2) + [1, 1, 2, 2]}
        nothing = {each.vehicle_id: np.zeros((2, 2)) for each in scenario.vehicles}
        (whole,) = tables([rows], scenario, None, nothing)
        vehicles = split(whole, scenario).vehicles
        assert vehicles[VehicleId(2, 1)]["north_m"].tolist() == [201.0, 202.0]
        assert vehicles[VehicleId(1, 1)]["north_m"].tolist() == [101.0, 102.0]


@pytest.mark.parametrize("order", [(1, 2, 3), (1, 3, 2), (2, 1, 3), (3, 1, 2), (3, 2, 1)])
def test_rows_are_their_vehicles_own_in_whatever_order_they_were_recorded(order):
    rows = {name: np.zeros(6) for name in MEASURED} | {"phase": np.zeros(6), "network": np.ones(6)}
    rows |= {"vehicle": np.tile(order, 2), "north_m": 100.0 * np.tile(order, 2) + [1, 1, 1, 2, 2, 2]}
    (whole,) = tables([rows], SCENARIO, None, dict.fromkeys((LEADER, FOLLOWER, THIRD), np.zeros((2, 2))))
    for vehicle, own in split(whole, SCENARIO).vehicles.items():
        assert own["north_m"].tolist() == [100.0 * vehicle.system + 1, 100.0 * vehicle.system + 2]


def test_the_least_of_no_finite_values_is_none():
    assert minimum(np.array([np.nan, np.inf])) is None
    assert minimum(np.array([np.nan, 3.0, 2.0])) == 2.0
