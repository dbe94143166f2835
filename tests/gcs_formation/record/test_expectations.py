"""An expectation is judged on what was flown, so that a passed one means what it says."""

from __future__ import annotations

from dataclasses import replace
from types import SimpleNamespace
from typing import Any, cast

import numpy as np
import pytest

from airlink.endpoint import VehicleId
from formation_scenario import load_scenario
from gcs_formation.record.expectations import RunOutcome, judge
from gcs_formation.record.flight import RecordedFlight
from gcs_formation.record.link_verdicts import LinkFigures, is_out
from gcs_formation.record.summary import _flying_on, _link, _lost
from gcs_formation.record.verdict import Verdict
from tests.gcs_formation.record.test_flight import CRASH_S, FOLLOWER, KEYS, LEADER, THIRD, flown

FLOWN_S = 10.0
PARTS: dict[str, Any] = {
    "duration_s": FLOWN_S,
    "followers": {str(system): {"settled_at_s": 0.0} for system in (1, 2, 3)},
    "safety": {"min_separation_m": 30.0, "min_clearance_m": 50.0},
    "control": {},
    "stability": {},
}


def verdict(cut_short: bool = False, crashed=(), faults=(), **expect) -> Verdict:
    """Return the verdict on an expectation of the second vehicle, in a flight of 10 s without errors."""
    entry = {"metric": "error_x_m.max", "followers": [2], "below": 0.1} | expect
    scenario = load_scenario(KEYS | {"duration_s": 100, "expect": [entry], "faults": list(faults)})
    (found,) = judge(scenario, flown(*crashed), PARTS, {}, cut_short)
    return found


def test_a_window_that_was_flown_is_judged_whatever_ended_the_flight_after_it():
    for cut_short in (False, True):
        assert verdict(cut_short, to_s=FLOWN_S).held is True
        assert verdict(cut_short, to_s=FLOWN_S, below=0).held is False


def test_a_window_that_the_flight_s_own_end_cut_short_is_broken_with_the_time_to_which_it_was_flown():
    found = verdict(from_s=2, to_s=90)
    assert (found.held, found.judged, found.reached) == (False, True, False)
    assert str(found).endswith("expected: below 0.1: broken: flown to 10.0 s of 90 s")
    assert verdict(from_s=50, to_s=90).held is False  # the path was never begun


@pytest.mark.parametrize(("network", "name"), [(1, 3), (2, "2:3")])
def test_a_follower_is_named_by_its_number_on_the_first_network_and_by_both_on_others(network, name):
    assert replace(verdict(to_s=FLOWN_S), vehicle=VehicleId(network, 3)).to_dict()["follower"] == name


def test_a_window_that_somebody_cut_short_is_not_judged():
    found = verdict(cut_short=True, from_s=2, to_s=90)
    assert (found.held, found.judged, found.reached) == (None, False, False)
    assert str(found).endswith("not judged: flown to 10.0 s of 90 s")
    assert found.to_dict()["reason"] == "flown to 10.0 s of 90 s"


@pytest.mark.parametrize("metric", ["min_separation_m", "min_clearance_m"])
@pytest.mark.parametrize(("from_s", "to_s", "held"), [(50, 90, False), (5.01, 5.03, None)])
def test_a_window_in_which_no_vehicle_was_seen_has_no_least_distance(metric, from_s, to_s, held):
    """Nor has it the whole flight's. It was flown, or the flight ended before it."""
    found = verdict(metric=metric, followers="all", below=None, above=10, from_s=from_s, to_s=to_s)
    assert (found.value, found.held) == (None, held)


def test_a_window_that_the_flight_s_end_cuts_by_up_to_3_s_is_judged():
    assert verdict(to_s=FLOWN_S + 3.0).held is True
    assert verdict(to_s=FLOWN_S + 3.1).held is False
    assert verdict(from_s=FLOWN_S, to_s=FLOWN_S + 2.9).held is None, "fewer than half of its ticks exist"


@pytest.mark.parametrize(
    ("from_s", "said"), [(2, "not recorded from 3.0 s to 7.0 s"), (3.5, "not recorded from 3.5 s to 7.0 s"), (7, "")]
)
def test_a_window_of_which_a_part_was_not_recorded_is_not_judged(from_s: float, said: str) -> None:
    """The station was killed after 3 s, and its flight continued at 7 s."""
    whole = flown()
    known = (whole.mission_time_s <= 3.0) | (whole.mission_time_s >= 7.0)
    parts = {vehicle: {name: values[known] for name, values in own.items()} for vehicle, own in whole.vehicles.items()}
    expect = {"metric": "error_x_m.max", "followers": [2], "below": 0.1, "from_s": from_s, "to_s": 9}
    scenario = load_scenario(KEYS | {"duration_s": 100, "expect": [expect]})
    (found,) = judge(scenario, RecordedFlight(parts), PARTS, {}, True)
    assert (found.held, found.reason) == (None if said else True, said)
    parts[FOLLOWER]["error_x_m"][-15] = 0.2
    (found,) = judge(scenario, RecordedFlight(parts), PARTS, {}, True)
    assert (found.held, found.judged, found.reason) == (False, True, said), "what was judged broke the bound"


@pytest.mark.parametrize("metric", ["min_separation_m", "min_clearance_m", "error_x_m.max"])
@pytest.mark.parametrize("planned", [True, False])
def test_what_is_expected_of_a_window_at_whose_end_no_vehicle_flies_is_broken(metric: str, planned: bool) -> None:
    """Also if the scenario's faults crash them all; if they crash one vehicle only, it isn't judged."""
    everyone = [LEADER, FOLLOWER, THIRD]
    faults = [{"at_s": 4.0, "vehicles": "all", "kind": "crash"}] if planned else []
    bounds = {"below": 0.1} if metric.startswith("error") else {"followers": "all", "below": None, "above": 10}
    wanted: dict[str, Any] = {"metric": metric, **bounds}
    found = verdict(crashed=everyone, faults=faults, to_s=FLOWN_S, **wanted)
    assert (found.held, found.reason) == (False, "none flew from 4.1 s on")
    assert verdict(crashed=everyone, faults=faults, to_s=CRASH_S, **wanted).held is True
    alone = verdict(crashed=everyone[1:], faults=faults, to_s=FLOWN_S, **wanted)
    assert alone.reason != "none flew from 4.1 s on"


@pytest.mark.parametrize("crashed", [[FOLLOWER], [LEADER]])
def test_a_follower_that_is_lost_before_its_window_ends_breaks_what_is_expected_of_it(crashed):
    """It has crashed, or its leader has and nobody succeeds it; it had no error while it flew."""
    expected: list[dict[str, Any]] = [{"below": 0.1}, {"metric": "in_slot_share", "below": None, "above": 0.9}]
    for each in expected:
        found = verdict(crashed=crashed, to_s=FLOWN_S, **each)
        assert (found.held, found.judged, found.reached) == (False, True, False)
        assert found.reason == "lost at 4.1 s"
    assert verdict(crashed=crashed, from_s=6, to_s=9.5).reason == "lost at 4.1 s", "also before the window"
    assert verdict(crashed=crashed, to_s=CRASH_S).held is True
    assert verdict(cut_short=True, crashed=crashed, to_s=90).held is False


@pytest.mark.parametrize(("to_s", "lost"), [(9.0, False), (9.1, True)])
def test_followers_whose_leader_has_just_crashed_are_not_lost_while_another_may_take_over(
    to_s: float, lost: bool
) -> None:
    """It crashes at 4.1 s. Those in flight behind it have no errors; one that is down is lost at once."""
    found = verdict(crashed=[LEADER], from_s=2, to_s=to_s)
    assert (found.lost, found.reached) == (lost, not lost)
    assert lost or found.reason.startswith("out of the formation for")
    assert verdict(crashed=[FOLLOWER], to_s=5.0).lost


def test_what_the_scenario_s_own_faults_crash_is_not_judged():
    faults = [{"at_s": 4.0, "vehicles": [2], "kind": "crash"}]
    found = verdict(crashed=[FOLLOWER], to_s=FLOWN_S, faults=faults)
    assert (found.held, found.judged, found.reason) == (None, False, "crashed at 4.0 s")
    assert verdict(crashed=[FOLLOWER], to_s=CRASH_S, faults=faults).held is True
    both = [{"at_s": 4.0, "vehicles": [2, 3], "kind": "crash"}]
    last = verdict(crashed=[FOLLOWER, THIRD], to_s=FLOWN_S, faults=both)
    assert (last.held, last.reason) == (False, "crashed at 4.0 s, and no other follows")
    others = [{"at_s": 4.0, "vehicles": [3], "kind": "crash"}]
    assert verdict(crashed=[FOLLOWER], to_s=FLOWN_S, faults=others).held is False
    assert verdict(crashed=[FOLLOWER], to_s=FLOWN_S, faults=[faults[0] | {"at_s": 8.0}]).held is False


@pytest.mark.parametrize(
    ("metric", "bounds", "held"),
    [
        ("error_x_m.max", {"below": 3.0}, False),
        ("error_x_m.max", {"below": 5.1}, None),
        ("error_x_m.max", {"below": None, "above": 6.0}, None),
        ("error_x_m.rms", {"below": 0.6}, None),
        ("error_x_m.rms", {"below": 0.4}, False),
        ("error_x_m.p99", {"below": 0.1}, None),
        ("settled_at_s", {"below": 1.0}, None),
    ],
)
def test_a_largest_error_that_was_beyond_its_bound_before_the_crash_stays_broken(
    metric: str, bounds: dict[str, Any], held: bool | None
) -> None:
    """It was 5 m at 2 s, 0.5 m RMS if the rest had none; percentiles and figures without value say nothing."""
    flight, to_s = flown(FOLLOWER), FLOWN_S if metric != "settled_at_s" else 100.0
    flight.vehicles[FOLLOWER]["error_x_m"][np.isclose(flight.mission_time_s, 2.0)] = 5.0
    expect = {"metric": metric, "followers": [2], "to_s": to_s} | bounds
    faults = [{"at_s": 4.0, "vehicles": [2], "kind": "crash"}]
    scenario = load_scenario(KEYS | {"duration_s": 100, "expect": [expect], "faults": faults})
    parts = PARTS | {"followers": {"2": {"settled_at_s": None}}}
    (found,) = judge(scenario, flight, parts, {}, cut_short=False)
    assert found.held is held
    assert found.reason == ("crashed at 4.0 s" if held is None else "before it crashed at 4.0 s")
    (cut,) = judge(scenario, flight, PARTS | {"duration_s": 5.0}, {}, cut_short=True)
    assert cut.held is held, "also if somebody cuts the window after that"


def test_a_follower_that_crashes_while_no_vehicle_leads_is_not_judged_either():
    """Both have crashed at 4.1 s, the leader by a fault at 4 s, it by one at 5 s; the third leads from 6 s on."""
    keys = KEYS | {
        "duration_s": 100,
        "faults": [{"at_s": 4.0, "vehicles": [1], "kind": "crash"}, {"at_s": 5.0, "vehicles": [2], "kind": "crash"}],
        "expect": [{"metric": "error_x_m.max", "followers": [2], "below": 0.1, "to_s": FLOWN_S}],
    }
    (found,) = judge(load_scenario(keys), flown(LEADER, FOLLOWER, third_leads_from_s=6.0), PARTS, {}, False)
    assert (found.held, found.judged, found.reason) == (None, False, "crashed at 5.0 s")
    (found,) = judge(load_scenario(keys), flown(LEADER), PARTS, {}, False)
    assert (found.held, found.reason) == (False, "lost at 4.1 s")


def test_a_lost_follower_s_time_counts_as_out_of_its_slot():
    found = verdict(crashed=[FOLLOWER], metric="in_slot_share", to_s=FLOWN_S, below=None, above=0.0)
    assert found.value == pytest.approx(41 / 101)


def test_no_delay_is_less_than_none_in_summary_and_verdict():
    """Half a cycle of the autopilot's loop is subtracted from each round trip; without link delay it may wait less."""
    probes_s = np.array([[-2e-5, np.nan, np.nan], [-1e-5, np.nan, np.nan], [3e-5, np.nan, np.nan]])
    link = LinkFigures(probes_s, np.arange(3.0), 0.0, 3, 3, 0)
    figures = _link(link, np.zeros(3))
    assert figures["measured_delay_ms"] == {"p50": 0.0, "p99": pytest.approx(0.0294)}
    assert str(figures["measured_delay_ms"]["p50"]) == "0.0"
    expect = [{"metric": "measured_delay_ms.p50", "followers": [2], "below": 1}]
    scenario = load_scenario(KEYS | {"expect": expect, "duration_s": FLOWN_S})
    (found,) = judge(scenario, flown(), PARTS, {scenario.vehicles[1].vehicle_id: link}, False)
    assert found.value == 0.0


@pytest.mark.parametrize(("metric", "frames"), [("jitter_ms.p99", 3), ("measured_loss", 0), ("frames_bad", 0)])
def test_a_link_that_nothing_came_over_meets_no_bound(metric: str, frames: int) -> None:
    """The last estimate of jitter stays in the table, however long no answer has come."""
    link = LinkFigures(np.zeros((3, 3)), np.arange(3.0) - 10.0, 0.0, frames, 3, 0)
    scenario = load_scenario(
        KEYS | {"expect": [{"metric": metric, "followers": [2], "below": 0.9}], "duration_s": FLOWN_S}
    )
    parts = PARTS | {
        "links": {str(each.vehicle_id): {"measured_loss": 0.0, "frames_bad": 0} for each in scenario.vehicles}
    }
    (found,) = judge(scenario, flown(), parts, {scenario.vehicles[1].vehicle_id: link}, False)
    assert found.value is None
    assert found.held is False


def link_verdict(metric: str, changes: Any = (), **link: Any) -> Verdict:
    """Return the verdict on a bound of 0.9 on a figure of the second vehicle's link, which is 0 or 0.5 to the end."""
    delays_s = np.full((11, 3), 5e-4)
    times_s = np.arange(11.0) - link.pop("ago_s", 0.0)
    figures = LinkFigures(delays_s, times_s, link.pop("loss", 0.0), 9, 9, 0, **link)
    expect = [{"metric": metric, "followers": [2], "below": 0.9}]
    scenario = load_scenario(KEYS | {"expect": expect, "duration_s": FLOWN_S, "links": {"changes": [*changes]}})
    identity = scenario.vehicles[1].vehicle_id
    parts = PARTS | {"links": {str(identity): {"measured_loss": figures.measured_loss, "frames_bad": 0}}}
    (found,) = judge(scenario, flown(), parts, {identity: figures}, False)
    return found


@pytest.mark.parametrize("metric", ["measured_delay_ms.p99", "measured_loss", "frames_bad"])
def test_figures_of_a_link_whose_vehicle_a_planned_fault_silenced_are_not_judged(metric: str) -> None:
    found = link_verdict(metric, due_to_s=4.0, heard_to_s=3.9)
    assert (found.held, found.judged, found.reached) == (None, False, False)
    assert found.reason == "silenced at 4.0 s by the scenario's faults"
    assert link_verdict(metric, due_to_s=FLOWN_S).reason == ""
    assert link_verdict(metric).held is True


def test_a_bound_that_a_link_broke_before_a_planned_fault_stays_broken() -> None:
    found = link_verdict("measured_loss", due_to_s=4.0, loss=0.95)
    assert (found.held, found.reason) == (False, "before it was silenced at 4.0 s by the scenario's faults")


@pytest.mark.parametrize(("metric", "held"), [("measured_delay_ms.p99", False), ("measured_loss", True)])
def test_a_link_that_fell_silent_by_itself_shows_no_delay_to_the_end(metric: str, held: bool) -> None:
    """Shares of the whole flight count the silence."""
    found = link_verdict(metric, heard_to_s=4.0)
    assert (found.held, found.judged, found.reason) == (held, True, "not heard from 4.0 s on")


@pytest.mark.parametrize(("metric", "held"), [("measured_delay_ms.p99", None), ("measured_loss", True)])
def test_what_is_measured_of_a_link_is_not_judged_after_an_outage_that_is_planned(
    metric: str, held: bool | None
) -> None:
    out = {"at_s": 4, "downlink": {"outage": True}}
    found = link_verdict(metric, [out], heard_to_s=4.0)
    assert found.held is held
    said = "silenced at 4.0 s by the scenario's links" if held is None else "not heard from 4.0 s on"
    assert found.reason == said
    over = [out, {"at_s": 4.5, "downlink": {"outage": False}}]
    assert link_verdict("measured_delay_ms.p99", over, heard_to_s=4.0).held is False


@pytest.mark.parametrize("planned", [True, False])
def test_delays_are_not_known_of_a_vehicle_that_answers_nothing_any_more(planned: bool) -> None:
    """It is received to the end; the last answer came 10.5 s before it."""
    out = [{"at_s": 0, "uplink": {"outage": True}}] if planned else []
    found = link_verdict("measured_delay_ms.p99", out, ago_s=10.5)
    assert found.held is (None if planned else False)
    assert found.reason == ("cut off at -0.5 s by the scenario's links" if planned else "no answer from -0.5 s on")
    assert link_verdict("measured_delay_ms.p99", ago_s=9.5).held is True
    assert link_verdict("measured_loss", out, ago_s=10.5).held is True
    assert found.lost


@pytest.mark.parametrize(("metric", "held"), [("measured_delay_ms.p99", None), ("measured_loss", True)])
def test_delays_are_not_judged_over_a_window_that_hardly_had_answers(metric: str, held: bool | None) -> None:
    """For 15 s of 60 s no answer came; a bound that the others broke is broken."""
    times_s = np.array([*np.arange(0.0, 20.0), *np.arange(35.0, 60.0)])
    for delay_s, found_held in ((5e-4, held), (2e-3, False if held is None else held)):
        link = LinkFigures(np.full((times_s.size, 3), delay_s), times_s, 0.0, 9, 9, 0)
        expect = [{"metric": metric, "followers": [2], "below": 0.9, "to_s": 60}]
        scenario = load_scenario(KEYS | {"duration_s": 60, "expect": expect})
        parts = PARTS | {"duration_s": 60.0, "links": {"2": {"measured_loss": 0.0}}}
        (found,) = judge(scenario, stretched(6.0), parts, {FOLLOWER: link}, False)
        assert found.held is found_held
        assert found.reason == ("no answer from 19.0 s to 35.0 s" if held is None else "")


def stretched(factor: float) -> RecordedFlight:
    """Return the flight of 10 s with its rows `factor` times as far apart, and as many more between."""
    whole = flown()
    rows = np.arange(round(whole.mission_time_s.size * factor))
    vehicles = {
        vehicle: {name: each[np.minimum(rows, each.size - 1)] for name, each in own.items()}
        for vehicle, own in whole.vehicles.items()
    }
    for own in vehicles.values():
        own["t_s"] = own["mission_time_s"] = rows * 0.1
    return RecordedFlight(vehicles)


@pytest.mark.parametrize("way", ["uplink", "downlink"])
@pytest.mark.parametrize("cut", [{"outage": True}, {"loss": 1}, {"delay_ms": 600_000}])
def test_a_link_over_which_nothing_comes_is_out_however_that_is_written(way: str, cut: dict[str, Any]) -> None:
    changes = [
        {"at_s": 4, way: cut},
        {"at_s": 8, way: dict.fromkeys(cut, 0) if "outage" not in cut else {"outage": False}},
    ]
    scenario = load_scenario(KEYS | {"duration_s": FLOWN_S, "links": {"changes": changes}})
    own = scenario.vehicles[1]
    assert [is_out(scenario, own, at_s, either=True) for at_s in (3.9, 4.0, 7.9, 8.0)] == [False, True, True, False]
    assert is_out(scenario, own, 5.0) is (way == "downlink")


@pytest.mark.parametrize(
    ("keys", "unsafe"),
    [
        ({}, True),
        ({"faults": [{"at_s": 5, "vehicles": [2], "kind": "ignore"}]}, False),
        ({"faults": [{"at_s": 5, "until_s": 8, "vehicles": [2], "kind": "ignore"}]}, True),
        ({"links": {"changes": [{"at_s": 5, "uplink": {"outage": True}}]}}, False),
    ],
)
def test_one_that_flies_on_after_the_flight_is_unsafe_unless_the_scenario_has_it_do_so(
    keys: dict[str, Any], unsafe: bool
) -> None:
    scenario, text = load_scenario(KEYS | {"duration_s": FLOWN_S} | keys), "vehicle 2 flies on in GUIDED"
    outcome = SimpleNamespace(scenario=scenario, flight=flown(), flying_on={FOLLOWER: text})
    assert list(_flying_on(cast("RunOutcome", outcome))) == ([text] if unsafe else [])


@pytest.mark.parametrize(("away_s", "said"), [(0.5, ""), (3.0, "out of the formation for 3.0 s of 10.1 s")])
def test_a_follower_that_was_away_and_came_back_is_said_to_have_been(away_s: float, said: str) -> None:
    """Its errors are those of the time in which it followed."""
    whole = flown()
    away = (whole.mission_time_s >= 4.0) & (whole.mission_time_s < 4.0 + away_s - 1e-6)
    own = {
        name: np.where(away, np.nan, values) if name.startswith("error") else values
        for name, values in whole.vehicles[FOLLOWER].items()
    }
    expect = {"metric": "error_x_m.max", "followers": [2], "below": 0.1, "to_s": FLOWN_S}
    scenario = load_scenario(KEYS | {"duration_s": 100, "expect": [expect]})
    flight = RecordedFlight({**whole.vehicles, FOLLOWER: own})
    (found,) = judge(scenario, flight, PARTS, {}, False)
    assert (found.held, found.reason) == (True, said)


@pytest.mark.parametrize(
    ("link", "keys", "lost"),
    [
        ({"heard_to_s": 3.0}, {}, True),
        ({}, {}, False),
        ({"heard_to_s": 5.0}, {}, False),
        ({"heard_to_s": 3.0, "due_to_s": 3.0}, {}, False),
        ({"heard_to_s": 3.0}, {"links": {"changes": [{"at_s": 3, "downlink": {"outage": True}}]}}, False),
        (
            {"heard_to_s": 3.0},
            {"links": {"changes": [{"at_s": 3, "outage": True}, {"at_s": 6, "outage": False}]}},
            True,
        ),
    ],
    ids=["silent", "heard", "had come down", "planned fault", "planned outage", "silent after an outage"],
)
def test_a_vehicle_that_falls_silent_in_the_air_for_good_is_lost(
    link: dict[str, Any], keys: dict[str, Any], lost: bool
) -> None:
    """It had no fault of the scenario's. It comes down at 4.1 s, so that one last received later was on the ground."""
    scenario = load_scenario(KEYS | {"duration_s": FLOWN_S} | keys)
    received = LinkFigures(np.zeros((1, 3)), np.zeros(1), 0.0, 9, 9, 0)
    own = replace(received, **link)
    links = {each.vehicle_id: received for each in scenario.vehicles} | {FOLLOWER: own}
    words = ["vehicle 2 was lost in the air: not heard from 3.0 s to the end"]
    assert list(_lost(scenario, flown(FOLLOWER), links)) == (words if lost else [])
