"""No verdict changes because ticks come up to a second late, at whichever edge of a window."""

from __future__ import annotations

from functools import cache
from typing import Any

import numpy as np
import pytest

from airlink.endpoint import VehicleId
from flight_model.arrays import Array
from formation_scenario import Scenario, load_scenario
from gcs_formation.record.coverage import coverage
from gcs_formation.record.expectations import judge
from gcs_formation.record.figures_of_merit import settled_at_s
from gcs_formation.record.flight import RecordedFlight, judged
from gcs_formation.record.lateness import late_ticks, lateness
from gcs_formation.record.link_verdicts import LinkFigures
from tests.gcs_formation.record.test_expectations import stretched
from tests.gcs_formation.record.test_flight import (
    FOLLOWER,
    KEYS,
    LEADER,
    SCENARIO,
    THIRD,
    flown,
    recorded,
    spool,
    truth,
)

PERIOD_S = 0.1
LATE_S = (0.05, 0.5, 1.0)


def held_up(whole: RecordedFlight, from_s: float, late_s: float) -> RecordedFlight:
    """Return a flight whose station was held up for a while: the tick due at `from_s` comes late, those after not."""
    time_s = whole.mission_time_s
    ends_s = from_s + late_s
    due = int(np.searchsorted(time_s, from_s - 1e-9))
    if due == time_s.size:
        return whole
    kept = (time_s < from_s - 1e-9) | (time_s > ends_s + 1e-9)
    kept[due] = True
    vehicles = {vehicle: {name: each[kept] for name, each in own.items()} for vehicle, own in whole.vehicles.items()}
    tick = int(kept[:due].sum())
    for vehicle, own in vehicles.items():
        shown = int(np.argmin(np.abs(time_s - ends_s)))  # the tick shows the state of its own time
        for name, each in own.items():
            each[tick] = whole.vehicles[vehicle][name][shown]
        own["mission_time_s"][tick] = own["t_s"][tick] = ends_s
    return judged(RecordedFlight(vehicles), SCENARIO)


FLIGHTS = {
    "all well": flown,
    "the follower crashes": lambda: flown(FOLLOWER),
    "the leader crashes": lambda: flown(LEADER),
    "all crash": lambda: flown(LEADER, FOLLOWER, THIRD),
    "it leads from 5 s on": lambda: recorded(spool(handed_over_s=5.0), truth()),
}
METRICS: dict[str, dict[str, Any]] = {
    "error_x_m.max": {"below": 0.1},
    "error_x_m.rms": {"below": 0.1},
    "in_slot_share": {"above": 0.9},
    "effort.speed.step_p95": {"below": 0.1},
    "min_separation_m": {"above": 10.0, "followers": "all"},
    "min_clearance_m": {"above": 10.0, "followers": "all"},
    "measured_delay_ms.p99": {"below": 10.0},
    "measured_loss": {"below": 0.1},
    "violations": {"below": 1, "followers": "all"},
    "settled_at_s": {"below": 1.0},
}
WINDOWS = ((0.0, 10.0), (0.0, 12.0), (2.0, 8.0), (6.0, 10.0), (0.0, 60.0))


@cache
def planned(duration_s: float) -> Scenario:
    """Return a scenario that expects every metric over every window, also beyond its duration."""
    expect = [
        {"metric": metric, "followers": [2], "from_s": from_s, "to_s": to_s} | bounds
        for metric, bounds in METRICS.items()
        for from_s, to_s in WINDOWS
        if metric.endswith(("_m", "_m.max", "_m.rms", "share", "p99")) or (from_s, to_s) == WINDOWS[-1]
    ]
    expecting = load_scenario(KEYS | {"duration_s": 60, "expect": expect})
    return load_scenario(KEYS | {"duration_s": duration_s}).model_copy(update={"expect": expecting.expect})


def outcomes(flight: RecordedFlight, cut_short: bool) -> dict[str, tuple[Any, ...]]:
    """Return the verdicts on every metric over every window; the flight ended by itself, or was cut."""
    scenario = planned(60.0 if cut_short else 10.0)
    flown_s = max(0.0, flight.scored_end_s(scenario.duration_s, PERIOD_S))
    parts = {
        "duration_s": flown_s,
        "followers": {str(system): {"settled_at_s": 0.1} for system in (1, 2, 3)},
        "safety": {"violations": 0},
        "control": {},
        "stability": {},
        "links": {str(each.vehicle_id): {"measured_loss": 0.0} for each in scenario.vehicles},
    }
    link = LinkFigures(np.full((11, 3), 5e-4), np.arange(11.0), 0.0, 9, 9, 0)
    links = {each.vehicle_id: link for each in scenario.vehicles}
    return {
        f"{each.expectation.metric} {each.expectation.from_s:g} to {each.expectation.to_s:g}": (
            *(each.held, each.judged, each.reached, each.lost),
        )
        for each in judge(scenario, flight, parts, links, cut_short)
    }


@pytest.mark.parametrize("cut_short", [False, True])
@pytest.mark.parametrize("name", FLIGHTS)
def test_no_verdict_changes_because_a_tick_is_late(name: str, cut_short: bool) -> None:
    """Also where the last tick of the flight comes late, after the path's end, or the first one."""
    whole = FLIGHTS[name]()
    on_time = outcomes(whole, cut_short)
    assert name != "all well" or {held for held, *_ in on_time.values()} == {True, None if cut_short else False}
    for late_s in LATE_S:
        for edge_s in (0.0, 2.0, 3.0, 6.0, 8.0, 10.0):
            for share in (0.0, 0.6):
                from_s = max(0.0, round((edge_s - share * late_s) / PERIOD_S) * PERIOD_S)
                found = outcomes(held_up(whole, from_s, late_s), cut_short)
                assert found == on_time, f"late by {late_s} s from {from_s:.1f} s on"


@pytest.mark.parametrize(
    ("missing", "share"),
    [([(4.0, 7.0)], 1.0), ([(4.0, 7.2)], 0.67), ([(0.0, 2.9)], 1.0), ([(7.05, 10.1)], 1.0), ([(6.0, 10.1)], 0.59)],
)
def test_up_to_3_s_without_a_row_count_as_judged(missing: list[tuple[float, float]], share: float) -> None:
    times_s = np.arange(0.0, 10.01, 0.1)
    for from_s, to_s in missing:
        times_s = times_s[(times_s < from_s - 1e-9) | (times_s > to_s - 1e-9)]
    assert coverage(times_s, 0.0, 10.0, 0.1).share == pytest.approx(share, abs=0.01)


def test_only_what_is_there_counts_if_more_than_half_of_the_rows_are_missing() -> None:
    times_s = np.arange(0.0, 10.01, 0.1)
    assert coverage(times_s[::2], 0.0, 10.0, 0.1).share == 1.0
    third = coverage(times_s[::3], 0.0, 10.0, 0.1)
    assert third.share == pytest.approx(0.34)
    assert str(third) == "recorded at 34 of 100 ticks"
    assert coverage(times_s[:0], 5.02, 5.04, 0.1).share == 0.0


def settled(outside_to_s: float, missing_from_s: float, missing_s: float, ends_s: float = 14.0) -> float | None:
    """Return the settling time of a vehicle that is outside of its slot until a time; rows are missing for a while."""
    time_s: Array = np.arange(1.0, round(ends_s / PERIOD_S) + 1.0) * PERIOD_S
    known = (time_s < missing_from_s - 1e-9) | (time_s > missing_from_s + missing_s - 1e-9)
    error_m = np.where(time_s[:, None] < outside_to_s - 1e-9, 0.6, 0.1) * np.ones(3)
    return settled_at_s(time_s[known], error_m[known], PERIOD_S, (0.0, ends_s))


@pytest.mark.parametrize("late_s", [0.0, 0.05, 0.5, 1.0])
def test_a_settling_time_doesn_t_depend_on_late_ticks(late_s: float) -> None:
    """In its slot from the beginning, or from 3 s on; late are the first ticks, those from 3 s on, or the last."""
    assert settled(0.0, 0.1, late_s) == pytest.approx(0.1)
    assert settled(3.0, 3.0, late_s) == pytest.approx(3.0)
    assert settled(4.0, 14.1 - late_s, late_s) == pytest.approx(4.0)
    assert settled(4.1, 14.1 - late_s, late_s) is None
    assert settled(1.0, 6.0, late_s) == pytest.approx(1.0)


def test_none_settles_over_a_gap_that_is_not_judged() -> None:
    assert settled(1.0, 4.0, 2.8) == pytest.approx(1.0)
    assert settled(1.0, 4.0, 3.5) is None
    assert settled(1.0, 4.0, 3.5, ends_s=18.0) == pytest.approx(7.5)


def ticks(*late_s: float, rate_hz: float = 10.0) -> np.ndarray:
    """Return (2, K) when ticks were due and began; one that is late takes the place of those due meanwhile."""
    due_s = np.arange(len(late_s)) / rate_hz
    begun_s = due_s + np.array(late_s)
    kept = np.concatenate(([True], due_s[1:] > np.maximum.accumulate(begun_s)[:-1] - 1e-9))
    return np.stack((due_s, begun_s))[:, kept]


def test_late_ticks_that_spoil_a_flight_are_said_with_what_they_mean() -> None:
    assert lateness(ticks(*[0.001] * 400), 10.0) is None
    assert lateness(ticks(*([0.0] * 200 + [1.0] + [0.0] * 199)), 10.0) is None, "a single one spoils nothing"
    slow = ticks(*[0.15, 0.0] * 200)
    assert late_ticks(slow) == 200
    text = lateness(slow, 10.0)
    assert text is not None
    assert text.startswith(
        "late ticks: 200 of 200 began more than 10 ms late, by up to 0.15 s, and there were 5 a second"
    )
    assert "instead of 10" in text
    some = lateness(ticks(*[0.02, 0.0, 0.0, 0.0] * 100), 10.0)
    assert some is not None
    assert "100 of 400" in some
    assert "10 a second on average" in some
    assert lateness(ticks(0.0), 10.0) is None
    few = [0.02] * 4 + [0.0] * 396
    assert lateness(ticks(*few), 10.0) is None, "one in a hundred"
    assert lateness(ticks(0.02, *few), 10.0) is not None


@pytest.mark.parametrize(
    ("crashed", "window_s", "late_from_s"), [(FOLLOWER, (2.0, 4.6), 4.2), (LEADER, (2.0, 9.5), 8.6)]
)
def test_one_that_is_lost_at_a_window_s_end_is_so_if_the_ticks_there_are_late(
    crashed: VehicleId, window_s: tuple[float, float], late_from_s: float
) -> None:
    """It crashes at 4.02 s. Shown is that at a single tick of the window, or for less than the 5 s for a successor."""
    from_s, to_s = window_s
    expect = [{"metric": "error_x_m.max", "followers": [2], "from_s": from_s, "to_s": to_s, "below": 0.1}]
    scenario = load_scenario(KEYS | {"expect": expect})
    parts = {"duration_s": 10.0, "followers": {"2": {"settled_at_s": None}}}
    for flight in (flown(crashed), held_up(flown(crashed), late_from_s, 1.0)):
        (found,) = judge(scenario, flight, parts, {}, False)
        assert (found.held, found.lost, found.reason) == (False, True, "lost at 4.1 s")


def test_steady_flight_that_late_ticks_hide_is_not_judged() -> None:
    """It settles at 1 s, and the flight is over at 31.2 s, so that 0.2 s of it are steady."""
    expect = [{"metric": "error_x_m.steady_max", "followers": [2], "below": 0.1}]
    scenario = load_scenario(KEYS | {"duration_s": 31.2, "expect": expect})
    for flight, settled_s, held in (
        (stretched(3.2), 1.0, True),
        (held_up(stretched(3.2), 30.9, 1.0), 1.0, None),
        (held_up(stretched(3.2), 30.9, 1.0), 2.0, False),
        (stretched(3.2), None, False),
    ):
        parts = {"duration_s": 31.2, "followers": {"2": {"settled_at_s": settled_s}}}
        (found,) = judge(scenario, flight, parts, {}, False)
        assert found.held is held
