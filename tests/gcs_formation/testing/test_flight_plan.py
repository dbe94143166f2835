import math
import shlex

import pytest

from formation_scenario import ScenarioError, load_scenario
from gcs_formation.testing.flight_plan import Formation, Plan

SCENARIO = """
vehicles: [{id: 1, role: leader}, {id: 2}, {id: 3}, {id: 3, network: 2}]
path: {waypoints_m: [[0, 0, 100], [4000, 0, 100]]}
links: {changes: [{at_s: 5, vehicles: [2], delay_ms: 10}]}
"""


@pytest.fixture
def plan(tmp_path) -> Plan:
    (tmp_path / "late.yaml").write_text(SCENARIO, encoding="utf-8")
    return Formation((tmp_path / "nowhere", tmp_path), tmp_path / "runs")("late.yaml")


def resolved(plan: Plan):
    return load_scenario(plan.scenario, plan.overrides())


def test_a_relative_path_is_looked_for_beside_the_test_then_from_the_root(plan, tmp_path):
    assert plan.scenario == tmp_path / "late.yaml"


def test_links_are_added_to_those_of_the_scenario(plan):
    scenario = resolved(plan.with_link(vehicle=2, delay_ms=300, loss=0.02).with_link("2:3", from_s=9, outage=True))
    _, second, *others = scenario.vehicles
    first, later = scenario.link_steps(second)
    assert (first.uplink.delay_ms, first.downlink.loss) == (300.0, 0.02)
    assert (later.at_s, later.uplink.delay_ms, later.uplink.loss) == (5.0, 10.0, 0.02)
    assert [len(scenario.link_steps(vehicle)) for vehicle in others] == [1, 2]


def test_an_outage_ends(plan):
    scenario = resolved(plan.with_outage([2], from_s=20, to_s=30))
    steps = {step.at_s: step for step in scenario.link_steps(scenario.vehicles[1])}
    assert [steps[at_s].downlink.outage for at_s in (0.0, 5.0, 20.0, 30.0)] == [False, False, True, False]


def test_a_plan_is_not_changed_by_what_is_made_of_it(plan):
    plan.with_link(delay_ms=300)
    assert plan.overrides() == ()


def test_keys_replace_those_of_the_scenario(plan):
    scenario = resolved(plan.with_keys(seed=7, law__delay_compensation=False, wind={"velocity_mps": [1, 2, 0]}))
    assert (scenario.seed, scenario.law.delay_compensation, scenario.wind.velocity_mps) == (7, False, (1.0, 2.0, 0.0))


def test_a_wrong_key_of_a_link_is_refused_with_what_was_meant(plan):
    with pytest.raises(ScenarioError, match=r"found an unknown key 'dely_ms'.*did you mean 'delay_ms'"):
        plan.with_link(2, dely_ms=3).fly()


def test_the_command_says_all_that_was_planned(plan, tmp_path):
    late = plan.with_keys(seed=3).with_link(2, delay_ms=300)
    words = shlex.split(late.command(tmp_path, until=60))
    assert words[:2] == ["gcs-formation", "run"]
    assert words[-4:] == ["--clock", "virtual", "--until", "60"]
    overrides = [words[i + 1] for i, word in enumerate(words) if word == "--set"]
    assert load_scenario(tmp_path / words[2], overrides) == resolved(late)


def test_the_command_against_real_endpoints_is_fly(plan, tmp_path):
    words = shlex.split(plan.against("real endpoints").command(tmp_path))
    assert words[:2] == ["gcs-formation", "fly"]
    assert "--clock" not in words


def test_a_mapping_is_flown_again_from_the_runs_own_copy(tmp_path):
    plan = Formation((), tmp_path)({"vehicles": {"count": 2}}, seed=3)
    assert shlex.split(plan.command(tmp_path / "flight-1"))[2].endswith("flight-1/run.yaml")


@pytest.mark.parametrize("to_s", [20, 10, math.nan])
def test_an_outage_ends_after_it_begins(plan, to_s):
    with pytest.raises(ValueError, match="found an outage from 20 s to"):
        plan.with_outage(2, from_s=20, to_s=to_s)


def test_an_unknown_opponent_is_refused(plan):
    """Anything else used to mean the real endpoints, whose vehicles are armed."""
    with pytest.raises(ValueError, match="found 'emulator'; allowed: emulators, real endpoints"):
        plan.against("emulator")


@pytest.mark.parametrize("late", [{"delay_ms": 300}, {"outage": True}, {"uplink": {"loss": 0.5}}])
def test_a_link_that_would_change_after_the_end_is_refused(plan, late, tmp_path):
    with pytest.raises(ValueError, match="found a link that changes at 7 s; the flight is over at 6 s"):
        plan.with_link(2, from_s=7, **late).fly(until=6)
    assert not (tmp_path / "runs").exists()


@pytest.mark.parametrize(
    ("late", "what"),
    [
        ({"links__changes": [{"at_s": 30, "delay_ms": 2000}]}, "a link that changes"),
        ({"links__changes__0__at_s": 30}, "a link that changes"),
        ({"links": {"changes": [{"at_s": 30, "loss": 1}]}}, "a link that changes"),
        ({"faults": [{"at_s": 2, "kind": "restart"}, {"at_s": 30, "kind": "crash"}]}, "a fault"),
        ({"disturbances": [{"at_s": 30, "velocity_mps": [1, 0, 0]}]}, "a disturbance"),
        ({"orders": [{"at_s": 30, "order": "shape line"}]}, "an order"),
        ({"formation__changes": [{"at_s": 30, "shape": "line"}]}, "a change of the formation"),
        ({"path__steps": [{"at_s": 30, "for_s": 5}]}, "a step of the path"),
    ],
)
def test_whatever_a_plan_adds_comes_before_the_end(plan, late, what, tmp_path):
    with pytest.raises(ValueError, match=f"found {what} at 30 s; the flight is over at 20 s"):
        plan.with_keys(**late).fly(until=20)
    assert not (tmp_path / "runs").exists()


def test_what_a_test_s_own_mapping_plans_comes_before_the_end(plan, tmp_path):
    keys = {"vehicles": {"count": 2}, "path": {"waypoints_m": [[0, 0, 100], [4000, 0, 100]]}}
    with pytest.raises(ValueError, match="found a fault at 30 s; the flight is over at 20 s"):
        Formation((), tmp_path)(keys | {"faults": [{"at_s": 30, "kind": "crash"}]}).fly(until=20)


def test_a_link_that_gets_worse_as_its_outage_ends_is_no_mere_end(plan):
    with pytest.raises(ValueError, match="found a link that changes at 7 s"):
        plan.with_link(2, from_s=7, uplink={"outage": False}, downlink={"loss": 0.5}).fly(until=6)


@pytest.mark.parametrize("way", ["both", "uplink"])
def test_an_outage_may_outlast_the_flight(plan, way):
    pair = [{"id": 1, "role": "leader"}, {"id": 2}]
    flight = plan.with_keys(vehicles=pair, start={"in_air": True, "run_in_s": 6})
    assert flight.with_outage(2, from_s=1, to_s=7, way=way).fly(until=2).link(2)
