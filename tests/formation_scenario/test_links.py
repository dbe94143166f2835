import pytest
from hypothesis import given
from hypothesis import strategies as st

from formation_scenario import ScenarioError, dump_scenario, load_scenario
from formation_scenario.links import min_mean_burst


def test_a_clean_link_has_one_state(load):
    scenario = load()
    (step,) = scenario.link_steps(scenario.vehicles[0])
    assert step.at_s == 0.0
    assert step.uplink == step.downlink
    assert (step.uplink.delay_ms, step.uplink.loss, step.uplink.distribution) == (0.0, 0.0, "normal")


def test_a_direction_differs_from_the_default_only_where_it_says_so(load):
    scenario = load("links.default={delay_ms: 50, uplink: {loss: 0.1}}", "links.downlink={delay_ms: 80}")
    (step,) = scenario.link_steps(scenario.vehicles[0])
    assert (step.uplink.delay_ms, step.uplink.loss) == (50.0, 0.1)
    assert (step.downlink.delay_ms, step.downlink.loss) == (80.0, 0.0)


def test_changes_build_on_the_state_before_them_in_time_order(load):
    scenario = load(
        "links.changes=[{at_s: 40, vehicles: [2], downlink: {delay_ms: 0}},"
        " {at_s: 20, vehicles: [2, 3], delay_ms: 300, loss: 0.2}, {at_s: 60, loss: 0}]"
    )
    steps = scenario.link_steps(scenario.vehicles[1])
    assert [step.at_s for step in steps] == [0.0, 20.0, 40.0, 60.0]
    assert [step.uplink.delay_ms for step in steps] == [0.0, 300.0, 300.0, 300.0]
    assert [step.downlink.delay_ms for step in steps] == [0.0, 300.0, 0.0, 0.0]
    assert [step.downlink.loss for step in steps] == [0.0, 0.2, 0.2, 0.0]
    assert [step.at_s for step in scenario.link_steps(scenario.vehicles[3])] == [0.0, 60.0]


def test_changes_at_one_time_are_one_step_and_those_at_0_hold_from_the_beginning(load):
    scenario = load(
        "links.changes=[{at_s: 0, vehicles: [2], delay_ms: 50}, {at_s: 9, delay_ms: 80}, {at_s: 9, loss: 0.1}]"
    )
    first, last = scenario.link_steps(scenario.vehicles[1])
    assert (first.at_s, first.uplink.delay_ms, first.uplink.loss) == (0.0, 50.0, 0.0)
    assert (last.at_s, last.uplink.delay_ms, last.uplink.loss) == (9.0, 80.0, 0.1)
    assert scenario.link_steps(scenario.vehicles[2])[0].uplink.delay_ms == 0.0


def test_every_impairment_can_differ_by_direction_and_in_time(load):
    scenario = load(
        "links.default={queue_ms: 200, loss: 0.2, mean_burst: 5, downlink: {reorder: true}}",
        "links.changes=[{at_s: 10, outage: true}, {at_s: 20, outage: false, uplink: {mean_burst: 2, queue_ms: 50}}]",
    )
    first, dead, last = scenario.link_steps(scenario.vehicles[1])
    assert (first.uplink.reorder, first.downlink.reorder) == (False, True)
    assert (first.uplink.outage, dead.uplink.outage, dead.downlink.outage, last.downlink.outage) == (
        False,
        True,
        True,
        False,
    )
    assert (last.uplink.mean_burst, last.downlink.mean_burst) == (2.0, 5.0)
    assert (last.uplink.queue_ms, last.downlink.queue_ms) == (50.0, 200.0)


@pytest.mark.parametrize(
    ("overrides", "expected"),
    [
        (["links.default.rate_kbps=1e-300"], "links.default.rate_kbps: found 1.0e-300; 0, or a number >= 0.001"),
        (["links.uplink.rate_kbps=-1"], "links.uplink.rate_kbps: found -1; 0, or a number >= 0.001"),
        (["links.default.mean_burst=0.5"], "links.default.mean_burst: found 0.5; a number from 1 to"),
        (["links.default.queue_ms=-1"], "links.default.queue_ms: found -1; a number from 0"),
        (["links.default.outage=perhaps"], "links.default.outage: found 'perhaps'; true or false"),
        (["links.uplink.reorder=1"], "links.uplink.reorder: found 1; true or false"),
        (["links.default.trace_file=3"], "links.default.trace_file: found 3; text"),
        (["links.changes=[{at_s: 1, downlink: {burst: 3}}]"], "links.changes.0.downlink.burst: found an unknown key"),
        (
            ["links.default={loss: 0.8, mean_burst: 2}"],
            "links.default.mean_burst: found 2 with a loss of 0.8 (uplink of vehicle 1); 4 or more with that loss",
        ),
        (
            [
                "links.default={loss: 0.2, mean_burst: 2}",
                "links.changes=[{at_s: 9, vehicles: [3], downlink: {loss: 0.75}}]",
            ],
            "links.changes.0.mean_burst: found 2 with a loss of 0.75 (downlink of vehicle 3); 3 or more with that loss",
        ),
        (["links.default={loss: 1, mean_burst: 9}"], "found 9 with a loss of 1 (uplink of vehicle 1); a loss below 1"),
    ],
)
def test_impairments_that_cannot_be_are_refused(refusal, overrides, expected):
    (line,) = refusal(*overrides)
    assert expected in line


@given(st.floats(0.0, 1.0, exclude_max=True))
def test_the_shortest_mean_burst_leaves_a_probability_to_begin_one(loss):
    """Gilbert's channel: loss = p / (p + r) with bursts of 1/r on average, so p = loss / (1 - loss) / burst."""
    burst = min_mean_burst(loss)
    assert burst >= 1.0
    assert loss / (1.0 - loss) / burst <= 1.0 + 1e-12


SCENARIO = """
vehicles: {count: 2}
path: {waypoints_m: [[0, 0, 100], [4000, 0, 100]]}
links:
  default:
    trace_file: delays/radio.txt
  changes:
    - {at_s: 10, downlink: {trace_file: delays/modem.txt}}
"""


@pytest.fixture
def traced(tmp_path):
    """Write a scenario of two trace files and the given texts into the first."""

    def write(radio: bytes = b"40 # ms\n\n# slower\n55.5\n", modem: bytes = b"0\n1e2\n"):
        (tmp_path / "delays").mkdir(exist_ok=True)
        (tmp_path / "delays" / "radio.txt").write_bytes(radio)
        (tmp_path / "delays" / "modem.txt").write_bytes(modem)
        path = tmp_path / "traced.yaml"
        path.write_text(SCENARIO, encoding="utf-8")
        return path

    return write


def test_trace_files_are_found_beside_the_scenario_and_again_from_its_resolved_copy(traced, tmp_path, monkeypatch):
    scenario = load_scenario(traced())
    elsewhere = tmp_path / "elsewhere"
    elsewhere.mkdir()
    monkeypatch.chdir(elsewhere)
    (elsewhere / "run.yaml").write_text(dump_scenario(scenario), encoding="utf-8")
    again = load_scenario(elsewhere / "run.yaml")
    assert again == scenario
    _, last = again.link_steps(again.vehicles[0])
    assert last.uplink.trace_file == str(tmp_path / "delays" / "radio.txt")
    assert last.downlink.trace_file == str(tmp_path / "delays" / "modem.txt")


@pytest.mark.parametrize(
    ("content", "found"),
    [
        (b"40\nfast\n", "radio.txt:2"),
        (b"40\n\n-1\n", "found a delay of -1 ms at"),
        (b"40 41\n", "found '40 41' at"),
        (b"1_000\n", "found '1_000' at"),
        (b"nan\n", "without a delay in it"),
        (b"600001\n", "found a delay of 600001 ms at"),
        (b"", "without a number in it"),
        (b"# nothing\n", "without a number in it"),
        (b"\xff\xfe4", "which isn't text in UTF-8"),
    ],
)
def test_a_file_that_holds_no_delays_is_refused_at_its_key(traced, content, found):
    with pytest.raises(ScenarioError) as refused:
        load_scenario(traced(content))
    (problem,) = refused.value.problems
    assert (problem.line, problem.key) == (6, "links.default.trace_file")
    assert found in problem.found
    assert problem.allowed.endswith("or a number on each line: delays from 0 to 600000 ms")


def test_a_trace_file_that_is_not_there_is_refused_with_the_path_looked_at(traced, tmp_path):
    path = traced()
    (tmp_path / "delays" / "modem.txt").unlink()
    with pytest.raises(ScenarioError) as refused:
        load_scenario(path)
    text = str(refused.value)
    assert text.startswith(
        f"{path}:8:29: links.changes.0.downlink.trace_file: found {tmp_path}/delays/modem.txt: No such"
    )


@pytest.mark.parametrize("nothing", ["at_s: 5", "at_s: 5, vehicles: [2], uplink: {}", "at_s: 5, delay_ms: null"])
def test_a_change_of_nothing_is_refused(load, nothing):
    with pytest.raises(ScenarioError, match=r"links\.changes\.0: found a change of nothing; allowed: one or more of"):
        load(f"links.changes=[{{{nothing}}}]")
