"""What is judged between the station's ticks, who is bound by the fence, and what wasn't seen."""

from __future__ import annotations

from typing import Any

import numpy as np
import pytest

from formation_scenario import load_scenario
from formation_scenario.planned_progress import planned_m
from gcs_formation.record.flight import RecordedFlight, judged
from gcs_formation.record.history import history
from gcs_formation.record.limits_by_truth import LimitSeries
from gcs_formation.record.safety import safety, value_within
from tests.gcs_formation.record.test_flight import KEYS, THIRD, TIME_S, flown, truth

HIGH_M = 30.0


def climbing(from_s: float = 4.0, to_s: float = 6.0) -> dict[str, Any]:
    """Return the truth of a flight in which the third vehicle is `HIGH_M` higher for a while, between two ticks."""
    rows = truth()
    within = (rows["time_s"] >= from_s) & (rows["time_s"] <= to_s)
    rows["height_m"] = rows["height_m"].copy()
    rows["height_m"][within, 2] += HIGH_M
    return rows


def limits(rows: dict[str, Any], fence: dict[str, Any], events=(), **more: Any) -> tuple[LimitSeries, RecordedFlight]:
    scenario = load_scenario(KEYS | {"safety": {"fence": fence}}, flown=True)
    flight = judged(flown(), scenario, lambda *_: rows, events, **more)
    assert flight.limits is not None
    return flight.limits, flight


def member(at_s: float, text: str, vehicle: str = "3") -> dict[str, Any]:
    return {"kind": "member", "t_s": at_s, "text": text, "vehicle": vehicle}


def test_a_moment_between_two_ticks_is_judged():
    found, flight = limits(climbing(4.03, 4.09), {"height_max_m": 110})
    assert found.fence_m.max() == pytest.approx(HIGH_M - 10.0)
    assert value_within(flight, "fence_m", 4.03, 4.09) == pytest.approx(HIGH_M - 10.0)
    assert value_within(flight, "fence_m", 4.2, 9.0) == 0.0
    scenario = load_scenario(KEYS | {"safety": {"fence": {"height_max_m": 110}}})
    (said,) = safety(scenario, flight, found).breaches
    assert said == "safety broken: vehicle 3 was 20 m outside the fence at 4.0 s; allowed: inside it (safety.fence)"


def test_what_the_station_knew_at_a_moment_is_what_it_knew_at_the_tick_before():
    found, _ = limits(truth(), {})
    late_s = found.time_s - TIME_S[found.tick]
    assert (late_s >= -1e-9).all()
    assert (late_s < TIME_S[1] + 1e-9).all()


def test_a_vehicle_that_its_pilot_flies_is_counted_apart_until_it_follows_again():
    taken, fence = member(3.0, "parted by its pilot"), {"height_max_m": 110}
    found, _ = limits(climbing(), fence, [taken])
    assert found.fence_m.max() == 0.0
    ((who, outside_m, at_s),) = found.by_pilots
    assert (who, outside_m, 4.0 <= at_s <= 6.0) == (THIRD, pytest.approx(HIGH_M - 10.0), True)
    back, _ = limits(climbing(), fence, [taken, member(4.5, "flying in formation")])
    assert back.fence_m.max() == pytest.approx(HIGH_M - 10.0)


def test_a_vehicle_beside_and_above_the_fence_is_outside_by_the_straight_way_back():
    """The leader is at 220 m north at the end, 40 m beyond the polygon's edge, and 30 m too high."""
    found, _ = limits(truth(), {"corners_m": [[-90, -9], [180, -9], [180, 9], [-90, 9]], "height_max_m": 70})
    assert found.fence_m[-1] == pytest.approx(50.0, abs=0.3)
    assert found.farthest[-1] == 0


def test_nothing_is_outside_without_a_fence_and_a_lowest_height_binds_who_flies_in_formation():
    low, _ = limits(truth(), {"height_min_m": 120})
    assert low.fence_m.max() == pytest.approx(20.0)
    none, _ = limits(climbing(), {})
    assert none.fence_m.max() == 0.0


def test_a_gap_of_more_than_a_second_is_said_and_so_is_an_early_end_of_the_truth():
    rows = truth()
    kept = (rows["time_s"] < 3.0) | (rows["time_s"] > 5.5)
    found, _ = limits({name: each[kept] for name, each in rows.items()}, {}, ended_s=14.0)
    assert found.unseen_s == [(pytest.approx(2.96), pytest.approx(5.52)), (pytest.approx(10.0), 14.0)]
    whole, _ = limits(rows, {}, ended_s=10.5)
    assert whole.unseen_s == []


def test_a_vehicle_is_its_pilots_until_it_follows_again_and_orders_of_speed_are_kept():
    order = {"kind": "order", "t_s": 9.0, "text": "speed 24: accepted", "accepted": True}
    refused = {"kind": "order", "t_s": 9.5, "text": "speed 99: refused", "accepted": False}
    texts = [(2.0, "parted by its pilot"), (2.4, "parted by its failsafe: 'RTL'"), (5.0, "starting")]
    past = history([*(member(*each) for each in texts), order, refused, member(8.0, "parted by its pilot", "2")])
    assert past.pilots_s == {"3": [(2.0, 5.0)], "2": [(8.0, np.inf)]}
    assert past.speeds_mps == [(9.0, 24.0)]


def test_where_the_path_s_time_puts_the_leader_follows_the_speeds_ordered():
    scenario = load_scenario(KEYS | {"path": {"speed_mps": 20, "waypoints_m": [[0, 0, 100], [4000, 0, 100]]}})
    times_s = np.array([5.0, 15.0, 25.0, 35.0])
    speeds = [(10.0, 25.0), (20.0, 0.0), (30.0, 10.0)]
    assert planned_m(scenario, times_s) == pytest.approx(20.0 * times_s)
    assert planned_m(scenario, times_s, speeds) == pytest.approx([100.0, 325.0, 450.0, 500.0])
