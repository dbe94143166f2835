"""What is measured of a link is judged while it is heard and answers, from both sides of each threshold."""

from __future__ import annotations

import math
from typing import Any

import numpy as np
import pytest

from airlink.endpoint import VehicleId
from formation_scenario import load_scenario
from formation_scenario.expectation import Expectation
from gcs_formation.record.expectations import crash_planned_s, figure_of, figure_of_run, judge
from gcs_formation.record.link_verdicts import LinkFigures, as_answered, is_out, link_verdict
from gcs_formation.record.verdict import Verdict
from tests.gcs_formation.record.test_expectations import PARTS
from tests.gcs_formation.record.test_flight import FOLLOWER, KEYS, TIME_S, flown

ENDS_S = 60.0


def verdict(value: float | None = 0.5, metric: str = "measured_delay_ms.p99", **more: Any) -> Verdict:
    """Return the verdict on a bound of 0.9 over a window from 10 s to 60 s."""
    wanted = Expectation.model_validate({"metric": metric, "below": 0.9, "from_s": 10, "to_s": ENDS_S})
    return Verdict(wanted, VehicleId(1, 2), value, **more)


def link(times_s: Any = None, **more: Any) -> LinkFigures:
    """Return a link with requests answered at some times, by default every second to the end."""
    asked_s = np.arange(0.0, ENDS_S + 0.5) if times_s is None else np.array(times_s)
    return LinkFigures(np.full((asked_s.size, 3), 5e-4), asked_s, 0.0, 9, 9, 0, **more)


@pytest.mark.parametrize(
    ("last_s", "end_s", "found_s"),
    [(50.0, 60.0, math.inf), (49.99, 60.0, 49.99), (50.0, 50.0, math.inf), (20.0, 29.0, math.inf)],
)
def test_a_link_answers_until_it_has_not_for_longer_than_10_s(last_s: float, end_s: float, found_s: float) -> None:
    assert link([0.0, last_s, 90.0, math.nan]).answered_to_s(end_s) == found_s
    assert link([]).answered_to_s(end_s) == -math.inf


@pytest.mark.parametrize(("heard_to_s", "silent"), [(59.9, True), (60.0, False), (60.1, False)])
def test_a_link_is_silent_that_was_heard_last_before_the_windows_end(heard_to_s: float, *, silent: bool) -> None:
    for out in (False, True):
        found = link_verdict(verdict(), link(heard_to_s=heard_to_s), ENDS_S, out=out)
        assert found.lost is silent
        assert found.held is (True if not silent else None if out else False)
    of_all = link_verdict(verdict(metric="measured_loss"), link(heard_to_s=heard_to_s), ENDS_S, out=True)
    assert (of_all.held, of_all.lost, of_all.reached) == (True, False, True), "a figure of the flight counts silence"


@pytest.mark.parametrize(("due_to_s", "due"), [(59.9, True), (60.0, False)])
def test_a_fault_that_silences_a_link_before_the_windows_end_leaves_it_unjudged(due_to_s: float, *, due: bool) -> None:
    found = link_verdict(verdict(), link(due_to_s=due_to_s), ENDS_S, out=False)
    assert (found.held, found.judged, found.lost) == (None if due else True, not due, due)
    assert found.reason == ("silenced at 59.9 s by the scenario's faults" if due else "")
    broken = link_verdict(verdict(1.5), link(due_to_s=due_to_s), ENDS_S, out=False)
    assert broken.held is False
    unknown = link_verdict(verdict(None), link(due_to_s=due_to_s), ENDS_S, out=False)
    assert unknown.held is (None if due else False)


def test_the_first_of_what_silences_a_link_is_said_and_a_fault_comes_before_an_outage() -> None:
    """One that answers nothing is cut off, if it is heard."""
    both = link_verdict(verdict(), link(due_to_s=40.0, heard_to_s=30.0), ENDS_S, out=True)
    assert both.reason == "silenced at 40.0 s by the scenario's faults"
    mute, heard = link([0.0, 20.0], heard_to_s=30.0), link([0.0, 20.0])
    assert link_verdict(verdict(), mute, ENDS_S, out=True).reason == "silenced at 20.0 s by the scenario's links"
    assert link_verdict(verdict(), heard, ENDS_S, out=True).reason == "cut off at 20.0 s by the scenario's links"
    assert link_verdict(verdict(), heard, ENDS_S, out=False).reason == "no answer from 20.0 s on"
    jitter = verdict(metric="jitter_ms.p50")
    assert link_verdict(jitter, heard, ENDS_S, out=False) == jitter, "jitter needs no answers"
    skipped = verdict(judged=False)
    assert link_verdict(skipped, mute, ENDS_S, out=True) == skipped


@pytest.mark.parametrize(
    ("gap_s", "share", "held"), [(10.0, 1.0, True), (10.01, 0.7998, None), (2.0, 1.0, True), (25.0, 0.5, None)]
)
def test_times_of_more_than_10_s_without_an_answer_are_not_judged(
    gap_s: float, share: float, held: bool | None
) -> None:
    """Anywhere in the window of 50 s, its ends included; times before and after it don't matter."""
    for begin_s in (10.0, 25.0, ENDS_S - gap_s):
        every_s = np.arange(0.0, 80.0, 0.5)
        edges_s = [each for each in (begin_s, begin_s + gap_s) if 10.0 < each < ENDS_S]
        times_s = np.concatenate((every_s[(every_s < begin_s) | (every_s > begin_s + gap_s)], edges_s))
        found = as_answered(verdict(), link(times_s[::-1]))
        assert found.share == pytest.approx(share)
        assert found.held is held
        assert found.reason == ("" if held else f"no answer from {begin_s:.1f} s to {begin_s + gap_s:.1f} s")
        assert as_answered(verdict(1.5), link(times_s)).held is False


def test_a_verdict_that_stands_for_another_reason_stays() -> None:
    few = link([11.0, 59.0])
    for stays in (verdict(metric="jitter_ms.p99"), verdict(judged=False), verdict(lost=True), verdict(reached=False)):
        assert as_answered(stays, few) == stays
    assert as_answered(verdict(), link([])) == verdict()
    assert as_answered(verdict(share=0.02), few) == verdict(share=0.02)
    assert as_answered(verdict(reason="led for 5.0 s"), few).reason == "led for 5.0 s; no answer from 11.0 s to 59.0 s"


@pytest.mark.parametrize("way", ["uplink", "downlink"])
def test_a_link_is_out_while_nothing_that_was_sent_since_can_have_come(way: str) -> None:
    """A delay of 2 s from 4 s on: the first of it comes at 6 s. Before the path the first state holds."""
    changes = [{"at_s": 4, way: {"delay_ms": 2000}}]
    scenario = load_scenario(KEYS | {"links": {"changes": changes}})
    own = scenario.vehicles[1]
    found = [is_out(scenario, own, at_s, either=True) for at_s in (0.0, 3.9, 4.0, 5.9, 6.0, 9.0, math.nan)]
    assert found == [False, False, True, True, False, False, False]
    lossy = load_scenario(KEYS | {"links": {"changes": [{"at_s": 4, way: {"loss": 0.99}}]}})
    assert not is_out(lossy, own, 5.0, either=True)
    silent = load_scenario(KEYS | {"links": {"default": {way: {"outage": True}}}}, flown=True)
    assert is_out(silent, silent.vehicles[1], math.nan, either=True)


METRICS = [
    ("measured_delay_ms.p50", 20.0), ("measured_delay_ms.p99", 29.8), ("jitter_ms.p50", 4.0), ("jitter_ms.p99", 5.96),
]  # fmt: skip


@pytest.mark.parametrize(("metric", "value"), METRICS)
def test_delays_and_jitter_are_percentiles_over_the_window_in_milliseconds(metric: str, value: float) -> None:
    """From 2 s to 6 s, both included: delays of 10, 20 and 30 ms, a jitter that rises from 2 to 6 ms."""
    delays_s = np.array([0.5, 0.01, 0.02, 0.03, 0.5])
    measured = LinkFigures(np.stack([delays_s] * 3, axis=1), np.array([1.99, 2.0, 4.0, 6.0, 6.01]), 0.0, 9, 9, 0)
    flight: Any = flown()
    flight.vehicles[FOLLOWER]["jitter_s"] = np.round(TIME_S, 1) * 1e-3
    expect = [{"metric": metric, "followers": [2], "below": 100, "from_s": 2, "to_s": 6}]
    scenario = load_scenario(KEYS | {"expect": expect})
    (found,) = judge(scenario, flight, PARTS, {FOLLOWER: measured}, cut_short=False)
    assert found.value == pytest.approx(value)
    nothing = LinkFigures(np.zeros((2, 3)), np.array([1.99, 6.01]), 0.0, 9, 9, 0)
    (none,) = judge(scenario, flight, PARTS, {FOLLOWER: nothing}, cut_short=False)
    assert none.value is None


def test_links_of_all_vehicles_are_judged_the_leaders_too() -> None:
    expect = [{"metric": "measured_loss", "below": 0.5}]
    scenario = load_scenario(KEYS | {"expect": expect})
    losses = {"1": 0.1, "2": 0.6, "3": 0.2}
    parts = PARTS | {"links": {name: {"measured_loss": loss} for name, loss in losses.items()}}
    links = {each.vehicle_id: link(np.arange(0.0, 10.5)) for each in scenario.vehicles}
    found = list(judge(scenario, flown(), parts, links, cut_short=False))
    assert [(each.vehicle.system, each.value, each.held) for each in found if each.vehicle] == [
        (1, 0.1, True),
        (2, 0.6, False),
        (3, 0.2, True),
    ]


def test_a_crash_is_planned_when_the_first_fault_of_the_vehicle_crashes_it() -> None:
    """Others' faults, and faults that crash none, don't."""
    faults = [
        {"at_s": 7.0, "vehicles": [2], "kind": "crash"},
        {"at_s": 5.0, "vehicles": "all", "kind": "crash"},
        {"at_s": 3.0, "vehicles": [3], "kind": "crash"},
        {"at_s": 1.0, "vehicles": [2], "kind": "ignore"},
    ]
    scenario = load_scenario(KEYS | {"faults": faults})
    assert [crash_planned_s(scenario, each.vehicle_id) for each in scenario.vehicles] == [5.0, 5.0, 3.0]
    assert crash_planned_s(load_scenario(KEYS), FOLLOWER) == math.inf


def test_figures_of_a_run_are_found_in_their_section_by_their_dotted_names() -> None:
    summary = {
        "safety": {"min_separation_m": 3.0},
        "control": {"period_ms": {"p50": 4.0, "max": None}},
        "stability": {"margin_used": 0.5},
        "real_time_factor": 7.0,
        "path": {"leader": {"across_m": {"rms": 8.0}}, "centre": {"height_m": {"max": 9.0}}},
    }
    found = {name: figure_of_run(summary, name) for name in (
        "min_separation_m", "period_ms.p50", "period_ms.max", "margin_used", "real_time_factor", "path_across_m.rms",
        "centre_height_m.max", "min_clearance_m", "late_ticks",
    )}  # fmt: skip
    assert list(found.values()) == [3.0, 4.0, None, 0.5, 7.0, 8.0, 9.0, None, None]
    assert figure_of_run({"safety": {}, "control": {}, "stability": {}}, "path_along_m.max") is None
    assert figure_of({"effort": None}, "effort.speed.step_p95") is None
