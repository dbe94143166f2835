"""What `check` shows by flying: errors in gusts, the time to assemble, silences; and within which wall time."""

from __future__ import annotations

from typing import Any

import numpy as np
import pytest

from formation_scenario import Scenario, load_scenario
from formation_scenario.planned_progress import planned_m
from formation_scenario.slot_assignment import first_arrangement
from gcs_formation.app.check import check_report
from gcs_formation.app.rehearsal.flying import flown
from gcs_formation.app.rehearsal.rehearsal import SETTLE_S, rehearsal_text, rehearsal_warnings, rehearse
from gcs_formation.app.rehearsal.silences import long_silences, silences
from gcs_formation.app.rehearsal.starts import goes_round, starts
from gcs_formation.app.rehearsal.stretches import from_there, worst_s
from gcs_formation.app.session import Session
from gcs_formation.phases import Phase
from tests.flights.conftest import scenario as flight
from tests.flights.in_memory import World

FOUR = [{"id": each} for each in range(1, 5)]
BENT = {
    "speed_mps": 22,
    "kind": "legs",
    "waypoints_m": [[0, 0, 100], [2000, 0, 100], [4000, 1000, 100], [9000, 1000, 100]],
}


def never() -> bool:
    """Return that time isn't over."""
    return False


def in_air(**keys: Any) -> Scenario:
    base = {"vehicles": {"count": 4}, "path": BENT, "start": {"in_air": True}}
    return load_scenario(base | keys)


@pytest.mark.parametrize(("delay_ms", "allowed_s"), [(0, 4.8), (300, 8.4)])
def test_a_run_in_too_short_to_begin_at_once_is_warned_of_with_what_it_takes(delay_ms: float, allowed_s: float) -> None:
    """Compared with flights: with the time that is allowed the path begins at once, with three tenths less it doesn't.

    Vehicles start in their slots, are received and answer four requests, each in turn; 2 s in slots, and 2 s before the
    path it is decided.
    """
    for run_in_s, rounds in ((allowed_s - 0.3, True), (allowed_s, False)):
        keys: dict[str, Any] = {
            "start": {"in_air": True, "run_in_s": run_in_s},
            "links": {"default": {"delay_ms": delay_ms}},
        }
        plan = load_scenario(flight(duration_s=5, vehicles={"count": 2}, **keys))
        told = goes_round(plan, starts(plan, never), 60.0)
        assert (told is not None) == rounds
        if told is not None:
            assert told.startswith(f"start.run_in_s: found {run_in_s:g}; allowed: {allowed_s:.1f} or more")
        world = World(**keys, duration_s=5, vehicles={"count": 2})
        world.run(run_in_s + 1.0)
        assert (world.station.flight.phase is Phase.ASSEMBLING) == rounds


def test_bursts_of_losses_that_last_for_seconds_at_a_slow_law_are_named_with_the_rate_that_is_enough() -> None:
    """In 24 such flights, one vehicle came within 4.3 m of another (slots 15 m apart), and within 2.2 m formerly.

    At 2 Hz, 11 datagrams per second: 0.22 bursts per second, of which 0.9^33 last longer than 3 s; four vehicles. So
    there are 5.4 silences in 200 s.
    """
    bursts: dict[str, Any] = {"loss": 0.2, "mean_burst": 10}
    path = {"speed_mps": 22, "waypoints_m": [[0, 0, 100], [12000, 0, 100]]}

    def said(rate_hz: float, **ways: Any) -> str | None:
        keys = {"law": {"rate_hz": rate_hz}, "links": {"default": bursts | ways}, "path": path}
        found = silences(load_scenario(flight(vehicles=FOUR, duration_s=200, **keys)), never)
        assert found is not None
        if rate_hz == 2.0 and not ways:
            assert 1 <= found.number <= 11  # 5.4, and 2.4 standard deviations about it
            assert 3.0 < found.longest_s < 15.0
        return long_silences(found)

    slow = said(2.0)
    assert slow is not None
    enough_hz = float(slow.partition("law.rate_hz of ")[2].partition(" ")[0])
    assert said(enough_hz) is None
    assert said(2.0, mean_burst=4) is None
    assert said(2.0, loss=0.002) is None


def test_links_that_lose_nothing_have_no_silences() -> None:
    assert silences(in_air(links={"default": {"delay_ms": 300}}), never) is None


def test_nothing_is_flown_for_longer_than_the_time_that_there_is() -> None:
    """With none, a flight is over at its first event, and says nothing about gusts."""
    gusts = in_air(disturbances=[{"at_s": 0, "kind": "dryden", "wind_6m_mps": 12}])
    found = rehearse(gusts, wall_s=0.0)
    assert found.stretch is not None
    assert found.stretch.seconds < 1.0
    assert list(rehearsal_warnings(gusts, found, 60.0)) == []
    assert any(each.startswith("flown ahead: 0 s from the path's start on") for each in rehearsal_text(found))
    report = check_report(gusts, found)
    assert report["valid"] is True
    assert report["assembly"]["least_run_in_s"] is None
    assert report["rehearsal"]["stretch"]["errors_m"] == {}


def test_the_worst_stretch_is_where_gusts_meet_the_longest_delay() -> None:
    gust = {"at_s": 20, "kind": "dryden", "wind_6m_mps": 6}
    late = [{"at_s": 60, "delay_ms": 400}, {"at_s": 120, "delay_ms": 0}]
    assert worst_s(in_air()) == 0.0
    assert worst_s(in_air(links={"changes": late})) == 60.0
    assert worst_s(in_air(disturbances=[gust])) == 20.0
    assert worst_s(in_air(disturbances=[gust], links={"changes": late})) == 60.0
    over = gust | {"until_s": 50}
    assert worst_s(in_air(disturbances=[over], links={"changes": late})) == 20.0


def test_a_stretch_begins_where_the_leader_is_by_then_with_links_air_and_shape_of_then() -> None:
    planned = in_air(
        disturbances=[{"at_s": 30, "kind": "dryden", "wind_6m_mps": 6}],
        links={"changes": [{"at_s": 40, "delay_ms": 200}, {"at_s": 150, "delay_ms": 0}]},
        formation={"changes": [{"at_s": 50, "shape": "line", "spacing_m": 50}, {"at_s": 140, "shape": "square"}]},
        faults=[{"at_s": 110, "vehicles": [2], "kind": "crash"}],
        seed=4,
    )
    rest = from_there(planned, 100.0)
    from_m = float(planned_m(planned, np.array(100.0)))
    here, there = planned.leader_path.at(from_m), rest.leader_path.at(0.0)
    passed_m = planned.leader_path.length_m - rest.leader_path.length_m
    assert from_m - 60.0 <= passed_m <= from_m  # a piece of the curve at most
    assert abs(here.course_rad - there.course_rad) < 0.2
    ahead = rest.leader_path.at(500.0)
    same = planned.leader_path.at(passed_m + 500.0)
    assert (ahead.north_m, ahead.east_m) == pytest.approx((same.north_m, same.east_m))
    vehicle = rest.vehicles[1]
    assert [(step.at_s, step.uplink.delay_ms) for step in rest.link_steps(vehicle)] == [(0.0, 200.0), (50.0, 0.0)]
    assert [each.at_s for each in rest.disturbances] == [0.0]
    assert (first_arrangement(rest).shape, rest.formation.spacing_m) == ("line", 50.0)
    assert [(each.at_s, each.shape) for each in rest.formation.changes] == [(40.0, "square")]
    assert rest.faults == ()


GUSTS = {"at_s": 0, "kind": "dryden"}
CASES: dict[str, dict[str, Any]] = {
    "fuzzy_pid, 300 ms": {"links": {"default": {"delay_ms": 300}}, "disturbances": [GUSTS | {"wind_6m_mps": 6}]},
    "pid without prediction": {
        "law": {"type": "pid", "gains": "noise", "delay_compensation": False},
        "telemetry": {"rate_hz": 2},
        "links": {"default": {"delay_ms": 150}},
        "disturbances": [GUSTS | {"wind_6m_mps": 6}],
    },
    "consensus, 200 ms": {
        "law": {"type": "consensus"},
        "links": {"default": {"delay_ms": 200}},
        "disturbances": [GUSTS | {"wind_6m_mps": 6}],
    },
}


@pytest.mark.slow
@pytest.mark.parametrize("case", CASES)
def test_what_is_foretold_of_gusts_is_flown_whatever_the_seed(case: str) -> None:
    """A stretch of a minute is a sample of the errors of a flight: within a factor of 1.6 of those of other seeds."""

    def within_m(scenario: Scenario, from_s: float, to_s: float) -> list[float]:
        def enough(session: Session) -> bool:
            return session.station.flight.mission_time_s(session.clock.now()) > to_s

        errors_m = flown(scenario, enough, from_s).errors_m
        return [errors_m[axis] for axis in "xyz"]

    whole = [within_m(in_air(seed=seed, **CASES[case]), SETTLE_S, 240.0) for seed in (1, 2, 3)]
    mean_m = np.mean(whole, axis=0)
    for seed in (11, 12):
        planned = in_air(seed=seed, **CASES[case])
        ratio = within_m(from_there(planned, worst_s(planned)), SETTLE_S, SETTLE_S + 60.0) / mean_m
        assert ratio.min() > 1 / 1.6
        assert ratio.max() < 1.6
