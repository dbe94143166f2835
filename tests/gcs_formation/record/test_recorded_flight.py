"""What a recorded flight says of its vehicles, tick by tick, worked out by hand."""

from __future__ import annotations

import math
from typing import Any

import numpy as np
import pytest

from airlink.endpoint import VehicleId
from flight_model.arrays import Array
from formation_scenario import Scenario, load_scenario
from gcs_formation.record.figures_of_merit import avoidance_s, clearance_m, setpoint_steps
from gcs_formation.record.flight import RecordedFlight, down_at_end, judged, split, tables
from gcs_formation.record.timeseries import (
    ERROR,
    INJECTED,
    INJECTED_MEAN,
    LAW_ERROR,
    MEASURED,
    PHASES,
    SLOT,
    TRUTH,
    VIRTUAL_LEADER,
)
from tests.gcs_formation.record.test_flight import FOLLOWER, KEYS, LEADER, SCENARIO, THIRD, TIME_S, spool, truth

FLYING = PHASES.index("flying")


def flight(*vehicles: dict[str, Any], phase: Any = FLYING) -> Any:
    """Return a flight of some ticks, 0.1 s apart, with the columns given for each vehicle; the first leads."""
    ticks = max(len(value) for own in vehicles for value in own.values())
    common = {"t_s": 50.0 + np.arange(ticks) / 10.0, "mission_time_s": np.arange(ticks) / 10.0}
    common["phase"] = np.broadcast_to(phase, ticks)
    found = {}
    for number, own in enumerate(vehicles):
        plain = {"airborne": np.ones(ticks), "active": np.ones(ticks), "leads": np.full(ticks, float(number == 0))}
        errors = {name: np.full(ticks, math.nan if number == 0 else 0.0) for name in ERROR}
        found[VehicleId(1, 1 + number)] = common | plain | errors | {name: np.array(each) for name, each in own.items()}
    return RecordedFlight(found)


def test_a_window_is_of_the_scored_time_with_both_its_ends() -> None:
    found = flight({"airborne": [1.0] * 6}, phase=np.array([1, 1, 1, 1, 1, 2]))
    assert found.window(0.1, 0.3).tolist() == [False, True, True, True, False, False]
    assert found.window(0.1 + 5e-10, 0.3 - 5e-10).sum() == 3, "but for rounding"
    assert found.window(0.1 + 1e-6, 0.3 - 1e-6).sum() == 1
    assert found.window(0.0, 9.0).sum() == 5
    assert found.ended_s == 0.5
    assert found.scored_end_s(0.4, 0.1) == pytest.approx(0.4)
    assert math.isnan(RecordedFlight({LEADER: {"mission_time_s": np.array([])}}).ended_s)


@pytest.mark.parametrize(
    ("airborne", "down_s"),
    [
        ([[1, 1, 1, 1], [0, 0, 0, 0]], None),
        ([[0, 0, 0, 1], [0, 0, 0, 0]], None),
        ([[1, 1, 0, 0], [1, 0, 0, 0]], 0.2),
        ([[1, 0, 1, 0], [0, 0, 0, 0]], 0.3),
        ([[0, 0, 0, 0], [0, 0, 0, 0]], 0.0),
    ],
)
def test_none_flies_from_the_first_tick_after_the_last_flight_on(airborne: list[list[int]], down_s: float) -> None:
    found = flight(*({"airborne": np.array(each, float)} for each in airborne))
    assert found.down_from_s(0.0, 1.0) == (None if down_s is None else pytest.approx(down_s))
    assert found.down_from_s(7.0, 8.0) is None, "a window without a tick"
    said = f"all vehicles were down before the flight was over: from {down_s} s on"
    assert down_at_end(found) == (None if down_s is None else said)


def lost(*takes_part: int) -> Any:
    """Return a flight of a follower that has errors at some ticks."""
    known = np.array(takes_part) > 0
    return flight({"airborne": np.ones(known.size)}, {"error_y_m": np.where(known, 0.0, np.nan)})


@pytest.mark.parametrize(
    ("takes_part", "missed", "absent", "back", "ends"),
    [
        ((1, 1, 1, 1, 1, 1), 0, 0, True, False),
        ((1, 1, 0, 0, 0, 0), 2, 2, False, False),
        ((1, 1, 0, 0, 1, 0), 2, 2, True, False),
        ((1, 0, 1, 0, 0, 1), 1, 2, False, False),
        ((0, 0, 0, 0, 1, 1), 4, 4, True, False),
        ((1, 1, 1, 0), 1, 1, True, True),
    ],
)
def test_a_follower_is_lost_from_its_last_error_on_and_back_if_it_has_one_after_the_window(
    takes_part: tuple[int, ...], missed: int, absent: int, *, back: bool, ends: bool
) -> None:
    """The window is of four ticks. After the last tick of all it counts as back."""
    found = lost(*takes_part)
    window = found.window(0.0, 0.3)
    assert (found.missed(FOLLOWER, window), found.absent(FOLLOWER, window)) == (missed, absent)
    assert (found.is_back(FOLLOWER, window), found.ends_with(window)) == (back, ends)
    assert found.missed(LEADER, window) == 0, "who leads isn't lost"
    times_s, errors_m = found.scored(FOLLOWER, window)
    assert times_s.tolist() == pytest.approx([0.1 * n for n, known in enumerate(takes_part[:4]) if known])
    assert errors_m.shape == (4 - absent, 3)


def test_who_leads_has_followed_and_is_on_the_ground() -> None:
    leads = np.array([1.0, 1.0, 0.0, 0.0])
    found = flight({"leads": leads, "airborne": [1.0, 0.0, 0.0, 1.0]}, {"leads": 1.0 - leads})
    assert [found.leader_at(tick) for tick in range(4)] == [LEADER, LEADER, FOLLOWER, FOLLOWER]
    assert found.leads(FOLLOWER).tolist() == [False, False, True, True]
    assert found.leaderless(found.window(0.0, 1.0)).tolist() == [False, True, False, False]
    assert (found.has_followed(LEADER), found.has_followed(FOLLOWER)) == (True, True)
    assert found.followers(SCENARIO) == [LEADER, FOLLOWER]
    idle = flight({"leads": leads, "active": leads}, {"leads": 1.0 - leads, "active": 1.0 - leads})
    assert (idle.has_followed(LEADER), idle.followers(SCENARIO)) == (False, [FOLLOWER])
    none = flight({"leads": np.zeros(2)}, {"leads": np.zeros(2)})
    assert none.leader_at(0) is None


@pytest.mark.parametrize("true", [True, False])
def test_places_headings_and_heights_are_the_true_ones_where_there_is_truth(*, true: bool) -> None:
    known = {"north_m": [1.0, 2.0], "east_m": [3.0, 4.0], "height_m": [5.0, 6.0], "heading_rad": [0.1, 0.2]}
    seen = {f"true_{name}": np.array(each) + 100.0 for name, each in known.items()}
    found = flight(known | (seen if true else {}) | {"airborne": [1.0, 0.0]})
    more = 100.0 if true else 0.0
    assert found.truth is true
    assert found.position(LEADER).tolist() == [
        [1.0 + more, 3.0 + more, 5.0 + more],
        [2.0 + more, 4.0 + more, 6.0 + more],
    ]
    assert found.heading(LEADER).tolist() == [0.1 + more, 0.2 + more]
    np.testing.assert_array_equal(found.position_in_flight(LEADER)[1], [np.nan] * 3)
    assert found.position_in_flight(LEADER)[0].tolist() == [1.0 + more, 3.0 + more, 5.0 + more]


def test_clearance_is_known_in_flight_from_the_first_setpoint_to_a_landing_at_the_end() -> None:
    loitering = PHASES.index("loitering")
    phase = np.array([FLYING] * 4 + [loitering] * 3)
    own = {"clearance_m": np.arange(7.0) + 10.0, "active": [0.0, 1.0, 0.0, 1.0, 0.0, 0.0, 0.0]}
    stays, lands = flight(own, phase=phase), flight(own | {"airborne": [1.0] * 6 + [0.0]}, phase=phase)
    np.testing.assert_array_equal(stays.clearance(LEADER), [np.nan, 11.0, 12.0, 13.0, 14.0, 15.0, 16.0])
    np.testing.assert_array_equal(lands.clearance(LEADER), [np.nan, 11.0, 12.0, 13.0, np.nan, np.nan, np.nan])
    both = flight(own, {"clearance_m": np.full(7, 12.5)}, phase=phase)
    window = both.window(0.1, 0.2)
    assert clearance_m(both, window).tolist() == [11.0, 12.0]
    assert clearance_m(both, both.window(0.3, 0.3)).tolist() == [12.5]


def test_a_vehicle_that_yields_is_counted_by_its_ticks_once_whoever_yields() -> None:
    found = flight({"yielding": [0.0, 1.0, 1.0, 0.0]}, {"yielding": [0.0, 0.0, 1.0, 1.0]})
    assert avoidance_s(found, found.window(0.0, 1.0), 10.0) == pytest.approx(0.3)
    assert avoidance_s(found, found.window(0.0, 0.1), 2.0) == pytest.approx(0.5)


def test_steps_of_setpoints_are_between_ticks_at_which_both_were_sent() -> None:
    """A heading's are by the smaller angle."""
    columns = {
        "active": np.array([1.0, 1.0, 0.0, 1.0, 1.0]),
        "setpoint_speed_mps": np.array([20.0, 19.0, 25.0, 20.0, 22.5]),
        "setpoint_heading_rad": np.array([0.1, 2.0 * np.pi - 0.1, 0.0, 0.0, 0.5]),
        "setpoint_height_m": np.array([100.0, 107.0, 0.0, 0.0, -9.0]),
    }
    for channel, expected in (("speed", [1.0, 2.5]), ("heading", [0.2, 0.5]), ("height", [7.0, 9.0])):
        found = setpoint_steps(columns, channel)
        np.testing.assert_allclose(found, [np.nan, expected[0], np.nan, np.nan, expected[1]])


DELAYS = {
    LEADER: [(0.1, 0.3), (math.nan, 0.3), (0.1, math.nan)],
    FOLLOWER: [(math.nan, math.nan), (0.0, 0.0), (0.2, 0.6)],
}


def recorded(scenario: Scenario, rows: dict[str, Array], *, true: Any = None, delays: Any = None) -> dict[str, Array]:
    """Return the columns (T, V) of a spool's columns."""
    ticks = rows["t_s"].size // len(scenario.vehicles)
    injected = delays or {each.vehicle_id: np.zeros((ticks, 2)) for each in scenario.vehicles}
    (found,) = tables([rows], scenario, true and (lambda *_: true), injected)
    return found


def test_delays_that_were_injected_have_their_mean_over_the_directions_in_use() -> None:
    """NaN where all datagrams of a direction were lost, or nothing is injected."""
    rows = {name: each[:9] for name, each in spool().items()}
    delays = {**DELAYS, THIRD: [(math.inf, 0.4)] * 3}
    found = recorded(SCENARIO, rows, delays={vehicle: np.array(each) for vehicle, each in delays.items()})
    np.testing.assert_array_equal(found[INJECTED[0]][:, 0], [0.1, math.nan, 0.1])
    np.testing.assert_array_equal(found[INJECTED[1]][:, 1], [math.nan, 0.0, 0.6])
    np.testing.assert_allclose(found[INJECTED_MEAN][:, 0], [0.2, 0.3, 0.1])
    np.testing.assert_allclose(found[INJECTED_MEAN][:, 1], [math.nan, 0.0, 0.4])
    np.testing.assert_allclose(found[INJECTED_MEAN][:, 2], [0.4] * 3)


def test_a_resumed_flights_vehicles_are_in_the_scenarios_order() -> None:
    """Its spool had another order, also of vehicles with one number on two networks."""
    rows = spool()
    order = np.arange(TIME_S.size * 3).reshape(-1, 3)[:, [2, 0, 1]].ravel()
    mixed, plain = recorded(SCENARIO, {name: each[order] for name, each in rows.items()}), recorded(SCENARIO, rows)
    for name, values in plain.items():
        np.testing.assert_array_equal(mixed[name], values, err_msg=name)
    assert mixed["vehicle"][0].tolist() == [1.0, 2.0, 3.0]
    pair = [{"id": 1, "role": "leader"}, {"id": 2}, {"id": 2, "network": 2}]
    scenario = load_scenario(KEYS | {"vehicles": pair}, flown=True)
    rows = {name: each[:6] for name, each in spool().items()} | {
        "network": np.array([2.0, 1.0, 1.0] * 2),
        "vehicle": np.array([2.0, 2.0, 1.0] * 2),
        "north_m": np.arange(6.0),
    }
    found = recorded(scenario, rows)
    assert found["north_m"].tolist() == [[2.0, 1.0, 0.0], [5.0, 4.0, 3.0]]
    whole = split(found, scenario).vehicles
    assert [own["north_m"].tolist() for own in whole.values()] == [[2.0, 5.0], [1.0, 4.0], [0.0, 3.0]]
    assert list(whole) == [each.vehicle_id for each in scenario.vehicles]


def two(frame: str, leads_to: float, heads_to: float, slot_m: tuple[float, float, float]) -> tuple[Scenario, Any, Any]:
    """Return a scenario, one tick of a leader at the origin and a follower 30 m north, 40 m east and 5 m above it."""
    keys = {"vehicles": {"count": 2}, "formation": {"frame": frame}, "path": KEYS["path"]}
    rows = {name: np.zeros(2) for name in MEASURED} | {
        "network": np.ones(2), "vehicle": np.array([1, 2]), "phase": np.full(2, FLYING), "leads": np.array([1.0, 0.0]),
        "airborne": np.ones(2),
    }  # fmt: skip
    rows |= {name: np.array([np.nan, each]) for name, each in zip(SLOT, slot_m, strict=True)}
    rows |= {name: np.array([np.nan, 77.0]) for name in LAW_ERROR}
    names = {name.removeprefix("true_"): np.zeros((2, 2)) for name in TRUTH}
    rates = {name: np.zeros((2, 2)) for name in ("north_mps", "east_mps", "climb_mps")}
    true = names | rates | {"time_s": np.array([0.0, 1.0]), "airborne": np.ones((2, 2))}
    true |= {"north_m": np.array([[0.0, 30.0]] * 2), "east_m": np.array([[0.0, 40.0]] * 2)}
    true |= {"height_m": np.array([[100.0, 105.0]] * 2), "heading_rad": np.array([[leads_to, heads_to]] * 2)}
    return load_scenario(keys, flown=True), rows, true


@pytest.mark.parametrize(
    ("frame", "leads_to", "heads_to", "slot_m", "error_m"),
    [
        ("north", 1.0, 2.0, (30.0, 40.0, 5.0), (0.0, 0.0, 0.0)),
        ("north", 1.0, 2.0, (31.0, 42.0, 8.0), (1.0, 2.0, 3.0)),
        ("leader_heading", math.pi / 2, 2.0, (40.0, -30.0, 5.0), (0.0, 0.0, 0.0)),
        ("leader_heading", math.pi / 2, 2.0, (41.0, -32.0, 4.0), (1.0, -2.0, -1.0)),
        ("follower_heading", 1.0, math.pi, (-30.0, -40.0, 5.0), (0.0, 0.0, 0.0)),
        ("follower_heading", 1.0, math.pi, (-33.0, -36.0, 5.0), (-3.0, 4.0, 0.0)),
    ],
)
def test_errors_are_positive_behind_left_of_and_below_the_slot_in_the_formations_frame(
    frame: str, leads_to: float, heads_to: float, slot_m: tuple[float, float, float], error_m: tuple[float, ...]
) -> None:
    """docs/timeseries.md. Without truth they are those that the law saw."""
    scenario, rows, true = two(frame, leads_to, heads_to, slot_m)
    found = recorded(scenario, rows, true=true)
    assert [found[name][0, 1] for name in ERROR] == pytest.approx(error_m, abs=1e-9)
    assert all(math.isnan(found[name][0, 0]) for name in ERROR)
    blind = recorded(scenario, rows)
    assert [blind[name][0, 1] for name in ERROR] == [77.0] * 3
    down = recorded(scenario, rows | {"airborne": np.array([1.0, 0.0])})
    assert all(math.isnan(down[name][0, 1]) for name in ERROR)


def test_behind_a_virtual_leader_errors_are_relative_to_where_the_station_had_it() -> None:
    """It heads east; the first is 10 m south, 20 m west and 10 m above, the second 20 m north, 20 m east, 15 m above.

    Without truth they are those of the law.
    """
    _, rows, true = two("leader_heading", 0.0, 0.0, (0.0, 0.0, 0.0))
    keys = {"vehicles": [{"id": 1}, {"id": 2}], "path": KEYS["path"]}
    scenario = load_scenario(keys, flown=True)
    rows |= dict(zip(VIRTUAL_LEADER, (np.full(2, each) for each in (10.0, 20.0, 90.0, math.pi / 2)), strict=True))
    rows |= {"leads": np.zeros(2)} | {name: np.array([1.0, 2.0]) for name in SLOT}
    found = recorded(scenario, rows, true=true)
    assert [found[name][0].tolist() for name in ERROR] == [
        pytest.approx([20.0 + 1.0, -20.0 + 2.0]),
        pytest.approx([-10.0 + 1.0, 20.0 + 2.0]),
        pytest.approx([-10.0 + 1.0, -15.0 + 2.0]),
    ]
    blind = recorded(scenario, rows)
    np.testing.assert_array_equal(blind[ERROR[0]][0], rows[LAW_ERROR[0]])


def test_limits_of_a_flight_are_judged_to_its_last_tick_if_its_end_is_not_known() -> None:
    """Truth goes on to 10 s. Of a flight without a tick only the start is."""
    true: Any = truth()
    for ticks, ended_s, last_s in ((51, None, 5.0), (51, 7.0, 7.0), (0, None, 0.0)):
        columns = recorded(SCENARIO, {name: each[: 3 * ticks] for name, each in spool().items()}, true=true)
        limits = judged(split(columns, SCENARIO), SCENARIO, lambda *_: true, ended_s=ended_s).limits
        assert limits is not None
        assert limits.time_s[0] == 0.0
        assert limits.time_s[-1] == pytest.approx(last_s)


def test_the_ground_below_each_vehicle_is_that_at_its_place() -> None:
    """Without terrain it is level, at 0 m."""
    scenario, rows, true = two("north", 0.0, 0.0, (0.0, 0.0, 0.0))
    found = recorded(scenario, rows, true=true)
    assert found["ground_height_m"].tolist() == [[0.0, 0.0]]
    assert found["clearance_m"].tolist() == [[100.0, 105.0]]
    assert recorded(scenario, rows | {"height_m": np.array([3.0, 4.0])})["clearance_m"].tolist() == [[3.0, 4.0]]
    assert truth()["height_m"].shape[1] == 3
