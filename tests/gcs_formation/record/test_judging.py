"""Verdicts of followers at the edges of what is judged."""

from __future__ import annotations

from typing import Any

import numpy as np
import pytest

from flight_model.arrays import Array
from formation_scenario import load_scenario
from gcs_formation.record.expectations import judge
from gcs_formation.record.flight import RecordedFlight
from gcs_formation.record.lateness import late_ticks, lateness
from gcs_formation.record.path_distance import Distances
from gcs_formation.record.verdict import Verdict
from tests.gcs_formation.record.test_flight import FOLLOWER, KEYS, LEADER, SCENARIO, THIRD, TIME_S, flown

PARTS: dict[str, Any] = {
    "duration_s": 10.0,
    "followers": {str(system): {"settled_at_s": 0.0} for system in (1, 2, 3)},
    "safety": {"violations": 3},
    "control": {"period_ms": {"p50": 100.0}},
    "stability": {"margin_used": None},
    "real_time_factor": 20.0,
}


def verdicts(flight: Any, parts: Any = None, *, cut_short: bool = False, **expect: Any) -> list[Verdict]:
    """Return the verdicts on one expectation, by default of the second vehicle's largest forward error."""
    entry = {"metric": "error_x_m.max", "followers": [2], "below": 0.1} | expect
    scenario = load_scenario(KEYS | {"expect": [entry]}, flown=True)
    return list(judge(scenario, flight, PARTS | (parts or {}), {}, cut_short))


def with_errors(error_m: Array) -> Any:
    flight: Any = flown()
    flight.vehicles[FOLLOWER]["error_x_m"] = error_m
    return flight


@pytest.mark.parametrize(("away_ticks", "said"), [(9, ""), (10, "out of the formation for 1.0 s of 10.1 s")])
def test_a_second_out_of_the_formation_is_said(away_ticks: int, said: str) -> None:
    since_s = TIME_S - 3.95
    away = (since_s > 0.0) & (since_s < 0.1 * away_ticks)
    (found,) = verdicts(with_errors(np.where(away, np.nan, 0.0)), to_s=10.0)
    assert (found.reason, found.held, found.lost) == (said, True, False)


@pytest.mark.parametrize(
    ("missing", "to_s", "lost_at"),
    [
        ((5.95, 6.05), 6.0, None),
        ((5.95, 6.15), 6.0, 6.0),
        ((5.85, 6.05), 6.0, 5.9),
        ((9.95, 10.05), 10.0, None),
        ((9.85, 10.05), 10.0, 9.9),
        ((3.95, 4.05), 6.0, None),
    ],
)
def test_at_a_single_tick_a_follower_on_the_ground_is_not_lost_unless_it_still_is_at_the_next(
    missing: tuple[float, float], to_s: float, lost_at: float | None
) -> None:
    """It is down without errors there."""
    down = (TIME_S - missing[0] > 0.0) & (TIME_S - missing[1] < 0.0)
    flight = with_errors(np.where(down, np.nan, 0.0))
    flight.vehicles[FOLLOWER]["airborne"] = np.where(down, 0.0, 1.0)
    (found,) = verdicts(flight, to_s=to_s)
    assert (found.lost, found.reached) == (lost_at is not None, lost_at is None)
    assert found.reason == ("" if lost_at is None else f"lost at {lost_at:.1f} s")


@pytest.mark.parametrize(("since_s", "lost"), [(4.85, True), (4.95, False)])
def test_a_follower_in_flight_is_lost_without_a_leader_for_more_than_5_s(since_s: float, *, lost: bool) -> None:
    """To the window's end, at 9.9 s; each tick stands for its period."""
    (found,) = verdicts(with_errors(np.where(since_s < TIME_S, np.nan, 0.0)), to_s=9.9)
    assert found.lost is lost
    assert found.reason == ("lost at 4.9 s" if lost else "out of the formation for 5.0 s of 10.0 s")


@pytest.mark.parametrize(("ends_s", "reached"), [(9.5, True), (9.3, False)])
def test_a_flight_whose_last_ticks_are_late_was_flown_to_its_end(ends_s: float, *, reached: bool) -> None:
    """Two ticks before 9.6 s are missing. To 9.5 s is within 3 s of the window's end, to 9.3 s isn't."""
    kept = (TIME_S < 9.35) | ((TIME_S > 9.55) if reached else (TIME_S > 20.0))
    vehicles = {who: {name: each[kept] for name, each in own.items()} for who, own in flown().vehicles.items()}
    scenario = load_scenario(
        KEYS | {"duration_s": 9.5, "expect": [{"metric": "error_x_m.max", "to_s": 12.5, "below": 0.1}]}, flown=True
    )
    (found, _) = judge(scenario, RecordedFlight(vehicles), PARTS, {}, cut_short=False)
    assert found.reached is reached
    assert found.reason == ("" if reached else f"flown to {ends_s} s of 12.5 s")


def test_a_follower_whose_leader_was_succeeded_is_lost_from_its_own_loss_on() -> None:
    """The leader is down from 3 s to 5 s, when the third takes over; the second never follows again."""
    flight = with_errors(np.where(TIME_S < 2.95, 0.0, np.nan))
    flight.vehicles[FOLLOWER]["airborne"] = np.where(TIME_S < 7.95, 1.0, 0.0)
    flight.vehicles[LEADER]["airborne"] = np.where(TIME_S < 2.95, 1.0, 0.0)
    flight.vehicles[LEADER]["leads"] = np.where(TIME_S < 4.95, 1.0, 0.0)
    flight.vehicles[THIRD]["leads"] = np.where(TIME_S < 4.95, 0.0, 1.0)
    (found,) = verdicts(flight, to_s=10.0)
    assert (found.lost, found.reason) == (True, "lost at 5.0 s")


@pytest.mark.parametrize(
    ("settled_s", "from_s", "ends_s", "judged"),
    [(0.0, 0.0, 40.0, False), (0.0, 30.5, 40.0, True), (10.0, 0.0, 40.0, False), (10.1, 0.0, 40.0, True)],
)
def test_steady_flight_within_the_window_of_which_no_tick_exists_is_not_judged(
    settled_s: float, from_s: float, ends_s: float, *, judged: bool
) -> None:
    """It begins 30 s after settling; the record ends before. A figure that is there stands."""
    parts = {"duration_s": ends_s, "followers": {"2": {"settled_at_s": settled_s}, "3": {"settled_at_s": None}}}
    expect: dict[str, Any] = {"metric": "error_x_m.steady_max", "from_s": from_s, "to_s": 60.0}
    (found,) = verdicts(flown(), parts, **expect)
    assert found.reason.endswith(f"no tick from {settled_s + 30.0:.1f} s on") is not judged
    (other,) = verdicts(flown(), parts, **(expect | {"metric": "error_x_m.max"}))
    assert "no tick" not in other.reason


def test_figures_of_followers_of_the_path_and_of_the_run_are_found_by_their_names() -> None:
    swings = with_errors(0.3 * np.sin(TIME_S))
    window = (TIME_S > 1.95) & (TIME_S < 6.05)
    (rms,) = verdicts(swings, metric="error_x_m.rms", from_s=2, to_s=6)
    assert rms.value == pytest.approx(np.sqrt(np.mean((0.3 * np.sin(TIME_S[window])) ** 2)))
    (effort,) = verdicts(swings, metric="effort.speed.step_p95", to_s=10)
    assert effort.value == 0.0
    away = Distances(TIME_S, -2.0 * TIME_S, 3.0 * TIME_S)
    off_path = RecordedFlight(
        swings.vehicles, off_path={"leader": away, "centre": Distances(*(-each for each in away))}
    )
    names = {"path_across_m.max": 6.0, "path_along_m.max": 12.0, "centre_height_m.max": 18.0}
    for metric, value in names.items():
        (found,) = verdicts(off_path, metric=metric, followers="all", from_s=2, to_s=6)
        assert (found.value, found.vehicle) == (pytest.approx(value), None)
    runs = {"violations": 3.0, "period_ms.p50": 100.0, "margin_used": None, "real_time_factor": 20.0}
    for metric, figure in runs.items():
        (found,) = verdicts(swings, metric=metric, followers="all", to_s=10)
        assert found.value == figure


def test_every_follower_that_is_chosen_has_a_verdict() -> None:
    assert [each.vehicle for each in verdicts(flown(), followers="all", to_s=10)] == [FOLLOWER, THIRD]
    assert [each.vehicle for each in verdicts(flown(), followers=[3], to_s=10)] == [THIRD]
    assert [each.expectation.below for each in judge(SCENARIO, flown(), PARTS, {}, cut_short=False)] == []


def begun(*late_s: float, rate_hz: float = 10.0) -> Array:
    due_s = np.arange(len(late_s)) / rate_hz
    return np.stack((due_s, due_s + np.array(late_s)))


def test_a_tick_is_late_that_begins_more_than_10_ms_after_it_was_due() -> None:
    assert late_ticks(np.array([[0.0, 1.0, 2.0], [0.0099, 1.0101, 2.5]])) == 2
    assert late_ticks(np.array([[0.0, 0.0], [0.01, -0.5]])) == 0


@pytest.mark.parametrize(("late", "said"), [(1, False), (2, True)])
def test_more_than_one_late_tick_in_a_hundred_spoils_a_flight(late: int, *, said: bool) -> None:
    text = lateness(begun(*[0.02] * late, *[0.0] * (100 - late)), 10.0)
    assert text == (
        None if not said else "late ticks: 2 of 100 began more than 10 ms late, by up to 0.02 s, and there were 10 a "
        "second on average: errors and delays are those of a loop that was held up, not of law.rate_hz 10"
    )  # fmt: skip


@pytest.mark.parametrize(("rate_hz", "said"), [(9.45, True), (9.55, False), (20.0, False)])
def test_ticks_at_less_than_95_percent_of_their_rate_are_said(rate_hz: float, *, said: bool) -> None:
    """None of them is late; others are missing."""
    text = lateness(begun(*[0.0] * 50, rate_hz=rate_hz), 10.0)
    assert (text is not None) is said
    assert text is None or "late ticks: 0 of 50" in text
    assert text is None or "there were 9.45 a second instead of 10:" in text
    two = lateness(begun(0.0, 0.0, rate_hz=5.0), 10.0)
    assert two is not None
    assert "there were 5 a second instead of 10" in two


@pytest.mark.parametrize("later_s", [-0.01, 0.0, 0.01])
@pytest.mark.parametrize("broken", [True, False])
def test_a_follower_crashes_by_the_scenario_if_a_fault_was_due_by_the_tick_at_which_it_is_lost(
    later_s: float, broken: bool
) -> None:
    """It is lost at 4.1 s, after an error of 5 m; by a fault that was due later it isn't."""
    error_m = np.where(TIME_S < 1.0, 5.0, 0.0)
    flight: Any = flown(FOLLOWER)
    flight.vehicles[FOLLOWER]["error_x_m"] = np.where(TIME_S < 4.05, error_m, np.nan)
    lost_s = float(TIME_S[41])
    fault = {"at_s": lost_s + later_s, "vehicles": [2], "kind": "crash"}
    entry = {"metric": "error_x_m.max", "followers": [2], "below": 0.1 if broken else 6.0}
    (found,) = judge(load_scenario(KEYS | {"expect": [entry], "faults": [fault]}), flight, PARTS, {}, False)
    by_fault = later_s <= 0.0
    assert found.held is (None if by_fault and not broken else False)
    said = f"crashed at {lost_s + later_s:.1f} s" if by_fault else "lost at 4.1 s"
    assert found.reason == (f"before it {said}" if by_fault and broken else said)


@pytest.mark.parametrize(("back_s", "held", "said"), [(8.0, True, ""), (8.2, None, "not recorded from 5.0 s to 8.2 s")])
def test_late_ticks_around_one_without_an_error_are_one_gap(back_s: float, held: bool | None, said: str) -> None:
    """Each of the two is short, and it was away for a moment; together they are more than 3 s and a period."""
    whole = flown()
    seen = (TIME_S < 5.05) | (abs(TIME_S - 6.6) < 0.05) | (back_s - 0.05 < TIME_S)
    vehicles = {each: {name: values[seen] for name, values in own.items()} for each, own in whole.vehicles.items()}
    vehicles[FOLLOWER]["error_x_m"][51] = np.nan
    (found,) = verdicts(RecordedFlight(vehicles), to_s=10.0)
    assert (found.held, found.reason) == (held, said)
