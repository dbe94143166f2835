"""What `gcs-formation check` says about a scenario's graph and margins."""

from __future__ import annotations

import json
import math
from pathlib import Path
from typing import Any

import numpy as np
import pytest
import yaml
from click.testing import CliRunner

from formation_scenario import ScenarioError, load_scenario
from formation_scenario.consensus_graph import graph_adjacency
from formation_scenario.feasibility import refused_orders
from formation_scenario.planned_progress import path_end_s
from gcs_formation.app.check import _seconds, check_report
from gcs_formation.app.check_links import (
    HoldingPattern,
    holding_pattern,
    no_time_for_a_pattern,
    refused_rate,
    split_errors,
)
from gcs_formation.app.check_warnings import never_reached, slots_of_no_shape
from gcs_formation.cli import main
from gcs_formation.stability import consensus_delay_margin, scenario_delay_margin
from tests.flights.conftest import scenario as flight

PLAIN = {
    "schema": 1,
    "vehicles": {"count": 4, "model": {"tau_v_s": 2.0, "tau_psi_s": 2.0}},
    "law": {"type": "consensus", "consensus": {"k1": 0.1, "k2": 0.6, "k3": 0.5, "graph": "path"}},
    "path": {"waypoints_m": [[0, 0, 100], [3000, 0, 100]]},
}


@pytest.fixture
def check(tmp_path: Path):
    """Run `check` on a path with four vehicles; return its exit status and output."""
    file = tmp_path / "scenario.yaml"
    file.write_text(yaml.safe_dump(PLAIN))

    def run(*arguments: str) -> tuple[int, str]:
        result = CliRunner().invoke(main, ["check", str(file), "--no-fly", *arguments])
        return result.exit_code, result.output

    return run


def test_the_json_of_a_bad_scenario_has_every_problem_with_its_place(check) -> None:
    status, printed = check("--json", "--set", "law.type=pidd")
    assert status == 2
    answer, _ = json.JSONDecoder().raw_decode(printed)  # the text for users follows on standard error
    assert answer["valid"] is False
    assert [(problem["key"], problem["found"]) for problem in answer["problems"]] == [("law.type", "found 'pidd'")]


def test_the_json_has_the_consensus_margin_alone(check) -> None:
    status, printed = check("--json")
    assert status == 0
    margin_s = consensus_delay_margin(graph_adjacency("path", 4), 0.1, 0.6, 0.5)
    assert json.loads(printed)["delay_margin_s"] == {"consensus": pytest.approx(margin_s, abs=1e-9)}


def test_the_graph_is_printed_as_who_receives_from_whom(check) -> None:
    _, printed = check()
    assert "vehicle 2 receives from 1 (1), 3 (1)" in printed
    _, printed = check("--set", "law.consensus.graph=[[0,0,0,0],[2.5,0,0,0],[1,0,0,0],[1,0,0,0]]")
    assert "vehicle 1 receives from none" in printed
    assert "vehicle 2 receives from 1 (2.5)" in printed


@pytest.mark.parametrize(("compensated", "warned"), [("true", False), ("false", True)])
def test_a_delay_near_the_margin_is_warned_of_unless_it_is_predicted_over(check, compensated, warned) -> None:
    delayed = ("--set", "links.default.delay_ms=400", "--set", f"law.delay_compensation={compensated}")
    assert bool(json.loads(check("--json", *delayed)[1])["warnings"]) == warned


def test_the_slowest_way_up_and_down_of_all_vehicles_make_the_loop(check) -> None:
    """Every loop waits for the latest state: 0.3 s down of one, 0.2 s up of another, and half of each period."""
    down = "{at_s: 0, vehicles: [1], downlink: {delay_ms: 300}}"
    up = "{at_s: 0, vehicles: [3], uplink: {delay_ms: 200}}"
    assert json.loads(check("--json", "--set", f"links.changes=[{down}, {up}]")[1])["loop_delay_s"] == pytest.approx(
        0.6
    )


def test_the_link_of_a_leader_that_is_to_follow_is_in_its_loop(check) -> None:
    late = ("--set", "law={type: fuzzy_pid}", "--set", "links.changes=[{at_s: 0, vehicles: [1], delay_ms: 300}]")
    follows = ("--set", "formation.changes=[{at_s: 60, leader: 2}]")
    told = [json.loads(check("--json", *late, *more)[1])["loop_delay_s"] for more in ((), follows)]
    assert told == pytest.approx([0.1, 0.7])


def test_recorded_delays_count_with_their_mean(check, tmp_path: Path) -> None:
    """0.1 s constant and 0.2 s recorded each way, plus half of each period."""
    (tmp_path / "trace.txt").write_text("100\n300\n")
    links = ("--set", "links.default.delay_ms=100", "--set", f"links.default.trace_file={tmp_path / 'trace.txt'}")
    assert json.loads(check("--json", *links)[1])["loop_delay_s"] == pytest.approx(0.7)


def test_a_channels_delay_and_loss_count(check) -> None:
    def loop_s(channel: str) -> float:
        found: float = json.loads(check("--json", "--set", f"links.channels=[{channel}]")[1])["loop_delay_s"]
        return found

    clean_s = loop_s("{rate_kbps: 500}")
    assert loop_s("{rate_kbps: 500, delay_ms: 100}") == pytest.approx(clean_s + 0.2)
    assert loop_s("{profile: satellite_geo}") == pytest.approx(clean_s + 0.56, abs=0.01)
    assert loop_s("{profile: satellite_geo, delay_ms: 100}") == pytest.approx(clean_s + 0.2, abs=0.01)


def test_recorded_delays_that_are_too_long_or_without_times_are_named(check, tmp_path: Path) -> None:
    file = tmp_path / "ping.csv"
    file.write_text("t_s,rtt_ms\n0,100\n1,3000\n2,100\n3,100\n")
    trace = ("--set", f"links.uplink={{trace: {{file: {file}, time: t_s}}}}")

    def named(*links: str) -> list[str]:
        return [text for text in json.loads(check("--json", *links)[1])["warnings"] if text.startswith(str(file))]

    (text,) = named(*trace, "--set", "law.max_age_s=1")
    assert text.startswith(f"{file}: 25.0% of its delays are longer than law.max_age_s, 1 s, up to 1.5 s")
    (text,) = named(*trace, "--set", "links.default.delay_ms=600", "--set", "law.max_age_s=2")
    assert "25.0% of its delays are longer than law.max_age_s, 2 s, up to 2.1 s" in text
    assert named(*trace, "--set", "law.max_age_s=2") == []
    file.write_text("100\n")
    (text,) = named("--set", f"links.default.trace_file={file}")
    assert "doesn't say when each delay was measured; 1 s from one to the next is assumed" in text


@pytest.mark.parametrize(("rate_hz", "warned"), [(0.5, True), (2.0, False)])
def test_loops_that_lags_a_little_off_make_unstable_are_warned_of(check, rate_hz, warned) -> None:
    slow = ("--set", "law.type=fuzzy_pid", "--set", f"telemetry.rate_hz={rate_hz}", "--set", f"law.rate_hz={rate_hz}")
    found = json.loads(check("--json", *slow)[1])
    assert (min(found["lag_margin"].values()) < 0.3) == warned
    told = [text for text in found["warnings"] if "of delay it is stable" in text]
    assert [text.startswith("loop x: at 2.000 s of delay") for text in told] == [True] * warned


@pytest.mark.parametrize(("law", "loops"), [("consensus", ["consensus"]), ("fuzzy_pid", ["x", "y", "z"])])
def test_predicted_loops_have_a_margin_against_mismatch_alone(check, law, loops) -> None:
    found = json.loads(check("--json", "--set", f"law.type={law}", "--set", "links.default.delay_ms=300")[1])
    assert list(found["mismatch_margin_s"]) == loops
    assert all(value is None or value > 0.0 for value in found["mismatch_margin_s"].values())
    plain = ("--set", "law.delay_compensation=false", "--set", f"law.type={law}")
    assert json.loads(check("--json", *plain)[1])["mismatch_margin_s"] == {}


def test_a_directed_ring_is_unstable_without_delay(check) -> None:
    ring = "law.consensus.graph=[[0,1,0,0],[0,0,1,0],[0,0,0,1],[1,0,0,0]]"
    _, printed = check("--json", "--set", "law.consensus.k1=1", "--set", "law.consensus.k2=0.1", "--set", ring)
    assert "unstable without any delay" in json.loads(printed)["warnings"][0]


def test_a_graph_without_a_spanning_tree_is_refused(check) -> None:
    status, printed = check("--set", "law.consensus.graph=[[0,1,0,0],[1,0,0,0],[0,0,0,1],[0,0,1,0]]")
    assert status == 2
    assert "law.consensus.graph: found none from which all receive" in printed


@pytest.mark.parametrize(
    ("rate_kbps", "ways"), [(0, []), (12, ["downlink", "uplink"]), (14.4, ["downlink"]), (57.6, [])]
)
def test_a_link_that_is_too_narrow_for_what_goes_over_it_is_warned_of(rate_kbps: float, ways: list[str]) -> None:
    """In a flight at 14.4 kbit/s and 10 Hz, an ArduPlane's messages waited for 0.5 s, and 18 % were lost."""
    plan = load_scenario(flight(duration_s=5, vehicles={"count": 2}, links={"default": {"rate_kbps": rate_kbps}}))
    told = [text for text in check_report(plan)["warnings"] if "kbit/s" in text]
    assert sorted(text.split()[3] for text in told if text.startswith("vehicle 2:")) == ways


def test_circles_that_are_lifted_at_the_paths_end_are_told_with_place_and_figure():
    """The hill's top is 150 m beside the path's end, which is 100 m high; 60 m above 90 m are 150 m."""
    hill = {"shape": "cosine", "north_m": 2000, "east_m": 150, "height_m": 90, "radius_m": 100}
    path = {"speed_mps": 22, "waypoints_m": [[0, 0, 100], [2000, 0, 100]]}
    planned = load_scenario(flight(terrain={"clearance_m": 60, "hills": [hill]}, path=path, duration_s=100))
    told, *_ = [text for text in check_report(planned)["warnings"] if text.startswith("path at 2000 m")]
    assert told == (
        "path at 2000 m, the flight's end: vehicles circle 50.0 m above it, at 150 m and higher, for the ground at "
        "north 2000, east 150"
    )


STRAIGHT_ON = {"speed_mps": 22, "waypoints_m": [[3000, 3000, 100], [5000, 3000, 100]]}


@pytest.mark.parametrize(
    ("height_m", "found"), [(150, "to -17.0 m above the ground straight on, at north 5231"), (50, "")]
)
def test_a_hill_straight_beyond_the_flights_end_is_told_where_vehicles_cannot_climb_in_time(
    height_m: float, found: str
) -> None:
    """Its top is 250 m ahead: climbing at 3 m/s they hit it. Over a hill of 50 m they are 10 m higher in time."""
    hill = {"shape": "cosine", "north_m": 5250, "east_m": 3000, "height_m": height_m, "radius_m": 300}
    planned = load_scenario(flight(terrain={"clearance_m": 60, "hills": [hill]}, path=STRAIGHT_ON, duration_s=100))
    told = [text for text in check_report(planned)["warnings"] if "straight on" in text]
    assert len(told) == bool(found)
    assert not told or found in told[0]


def test_holes_of_elevation_data_below_the_last_circles_are_told(tmp_path: Path) -> None:
    """A tile of zeros, one of which is missing 400 m beyond the path's end; the grid has 93 m."""
    elevations = np.zeros((1201, 1201), dtype=">i2")
    for north_m, told in ((5400, True), (6400, False)):
        elevations[:] = 0
        elevations[1200 - round(north_m / 92.5), round(3000 / 75.9)] = -32768
        elevations.tofile(tmp_path / "N35E125.hgt")
        ground = {"clearance_m": 60, "file": str(tmp_path / "N35E125.hgt")}
        planned = load_scenario(flight(terrain=ground, path=STRAIGHT_ON, duration_s=100))
        assert any("found no elevation at north 5" in text for text in check_report(planned)["warnings"]) == told


@pytest.mark.parametrize(("turn_rps", "told"), [(0.95, False), (0.96, True), (14.0, True)])
def test_a_turn_rate_that_takes_more_bank_than_any_autopilot_allows_is_told(turn_rps: float, told: bool) -> None:
    """At 22 m/s a bank of 65 degrees turns by 9.80665 tan(65 degrees) / 22 = 0.956 rad/s."""
    model = {"turn_rate_max_rps": turn_rps}
    planned = load_scenario(flight(vehicles={"count": 3, "model": model}))
    found = [text for text in check_report(planned)["warnings"] if "a bank of" in text]
    assert bool(found) == told
    assert not told or f"found {turn_rps:g} rad/s" in found[0]
    assert not told or found[0].endswith("at 22 m/s; 65° are 0.96 rad/s")


@pytest.mark.parametrize(("spacing_m", "told"), [(5.0, True), (5.99, True), (6.0, False)])
def test_slots_that_leave_no_room_for_errors_are_told(spacing_m: float, told: bool) -> None:
    """Slots 5 m apart may be flown, but an error of a millimetre breaks a separation of 5 m."""
    wide, near = {"shape": "line", "spacing_m": 30}, {"at_s": 20, "spacing_m": spacing_m}
    planned = load_scenario(flight(formation=wide | {"changes": [near]}))
    found = [text for text in check_report(planned)["warnings"] if "left for errors" in text]
    who = "formation.changes.0.spacing_m: found slots of the leader and vehicle 2"
    said = f"{who} {spacing_m:.3g} m apart in line, 5 m asked for (safety.separation_m): no 1 m left for errors"
    assert found == ([said] if told else [])


def test_a_change_that_takes_longer_than_the_flight_is_told() -> None:
    """The change from diamond to line takes 14.7 s."""
    changes = {"shape": "diamond", "spacing_m": 30, "changes": [{"at_s": 20, "shape": "line"}]}
    for duration_s, told in ((30, True), (40, False)):
        planned = load_scenario(flight(formation=changes, duration_s=duration_s))
        texts = [text for text in check_report(planned)["warnings"] if text.startswith("formation.changes.0: ")]
        assert bool(texts) == told
        assert not told or texts[0].endswith("s from 20 s on, and the flight is over at 30 s")


def test_what_is_planned_for_after_the_flight_is_warned_of() -> None:
    late = {
        "faults": [{"at_s": 50, "kind": "crash", "vehicles": [2]}, {"at_s": 500, "kind": "crash", "vehicles": [2]}],
        "expect": [{"metric": "error_x_m.max", "from_s": 140, "to_s": 150, "below": 1}],
        "duration_s": 600,
    }
    scenario = load_scenario(PLAIN | late)  # 3000 m at 22 m/s
    assert list(never_reached(scenario)) == [
        "duration_s: found 600; the path ends at 136.4 s; windows of expect that reach 3 s beyond are broken",
        "faults.1.at_s: found 500; the flight is over at 136.4 s",
        "expect.0.from_s: found 140; the flight is over at 136.4 s",
    ]
    steps = "path.steps=[{at_s: 9, for_s: 5}, {at_s: 500, for_s: 5}]"
    assert list(never_reached(load_scenario(PLAIN, [steps]))) == [
        "path.steps.1.at_s: found 500; the flight is over at 136.4 s"
    ]
    slower = load_scenario(PLAIN | late | {"orders": [{"at_s": 9, "order": "speed 18"}]})
    assert list(never_reached(slower)) == []
    longer = load_scenario(PLAIN | {"expect": [{"metric": "late_ticks", "to_s": 150, "below": 1}], "duration_s": 100})
    assert list(never_reached(longer)) == ["expect.0.to_s: found 150; the flight is over at 100 s, so this is broken"]


def test_what_until_cuts_off_is_never_reached() -> None:
    changes = {"changes": [{"at_s": 20, "delay_ms": 300}]}
    keys = PLAIN | {"links": changes, "expect": [{"metric": "error_x_m.max", "to_s": 150, "below": 1}]}
    scenario = load_scenario(keys | {"duration_s": 100})
    assert list(never_reached(scenario, 10.0)) == ["links.changes.0.at_s: found 20; the flight is over at 10 s"]
    assert [text.partition(":")[0] for text in never_reached(scenario, 140.0)] == ["expect.0.to_s"]
    to_the_end = load_scenario(keys | {"duration_s": 600})
    assert [list(never_reached(to_the_end, until_s)) for until_s in (130.0, 140.0)] == [
        [],
        ["duration_s: found 600; the path ends at 136.4 s; windows of expect that reach 3 s beyond are broken"],
    ]


@pytest.mark.parametrize(("wind_mps", "end_s"), [([0, 0, 0], 136.36), ([-2, 0, 0], 150.0), ([0, 9, 0], 149.45)])
def test_the_path_ends_when_the_leader_has_flown_it_in_the_wind(wind_mps: list[float], end_s: float) -> None:
    """3000 m north at 22 m/s through the air; a crosswind of 9 m/s leaves sqrt(22² - 9²) m/s."""
    assert path_end_s(load_scenario(PLAIN | {"wind": {"velocity_mps": wind_mps}})) == pytest.approx(end_s, abs=0.01)


def test_a_window_that_begins_after_the_flight_is_refused_with_the_time_of_its_end() -> None:
    late = {"expect": [{"metric": "error_x_m.max", "from_s": 140, "below": 1}], "duration_s": 2000}
    with pytest.raises(
        ScenarioError, match=r"expect\.0\.from_s: found 140; allowed: less than 137\.4 s, when the flight is over"
    ):
        load_scenario(PLAIN | late)


def test_planned_orders_that_will_be_refused_are_warned_of() -> None:
    bend = {"waypoints_m": [[0, 0, 100], [1500, 0, 100], [2000, 500, 100], [2000, 3000, 100]]}
    orders = ["speed 40", "shape line 3", "shape line 200", "speed 24", "rtl", "shape line 3"]
    planned = [{"at_s": 10 + n, "order": order} for n, order in enumerate(orders)]
    scenario = load_scenario({"vehicles": {"count": 4}, "path": bend, "orders": planned})
    told = dict(refused_orders(scenario))
    assert list(told) == [0, 1, 2]
    assert told[0] == "found 40 m/s; allowed: 16 to 28 m/s, leader 1's limits"
    assert told[1].startswith("found slots of the leader and vehicle")
    assert "slot in shape line would need" in told[2]
    assert check_report(scenario)["warnings"][0] == f"orders.0: 'speed 40' will be refused: {told[0]}"


def test_unequal_ways_are_warned_of_with_the_metres_that_they_cost_against_the_leaders() -> None:
    """22 m/s for half the difference, 160 ms of its own; from 30 s on the leader's is 40 ms in the other direction."""
    unequal = {"at_s": 0, "vehicles": [2], "uplink": {"delay_ms": 400}, "downlink": {"delay_ms": 80}}
    leaders = {"at_s": 30, "vehicles": [1], "uplink": {"delay_ms": 80}, "downlink": {"delay_ms": 160}}
    planned = load_scenario({"vehicles": {"count": 3}, "path": PLAIN["path"], "links": {"changes": [unequal, leaders]}})
    about_2, about_3 = split_errors(planned)
    assert "vehicle 2: 400 ms up and 80 ms down, the leader's 80 ms up and 160 ms down," in about_2
    assert "4.40 m along the path (behind its slot, from 30 s on)" in about_2
    assert "vehicle 3: 0 ms up and 0 ms down" in about_3
    assert "0.88 m along the path (behind its slot, from 30 s on)" in about_3


@pytest.mark.parametrize(
    ("clocks", "said"),
    [
        ([{}, {"utc": False}], ("behind", 2)),
        ([{"utc": False}, {}], ("ahead of", 1)),
        ([{}, {"utc_error_s": 0.4}], ("behind", 2)),
        ([{}, {"utc_error_s": 0.05}], None),
        ([{}, {}], None),
        ([{"utc": False}, {"utc": False}], None),
    ],
)
def test_who_has_no_utc_beside_others_that_fly_by_it_is_off_by_its_own_split(
    clocks: list[dict[str, Any]], said: tuple[str, int] | None
) -> None:
    """22 m/s times half of 400 minus 80 ms, for leader or follower; UTC with a smaller error could be true."""
    vehicles = [{"id": i + 1, "role": ("leader", "follower")[i], "clock": clock} for i, clock in enumerate(clocks)]
    links = {"default": {"uplink": {"delay_ms": 400}, "downlink": {"delay_ms": 80}}}
    keys = {"vehicles": vehicles, "path": PLAIN["path"], "links": links, "telemetry": {"clock": "gnss"}}
    found = "".join(split_errors(load_scenario(keys)))
    if said is None:
        assert found == ""
    else:
        assert f"leave a constant error of 3.52 m along the path ({said[0]} its slot): round trips don't" in found
        assert f"the UTC of vehicle {said[1]} can't be used" in found


def pattern_of(**keys: Any) -> HoldingPattern:
    straight = {"waypoints_m": [[0, 0, 200], [9000, 0, 200]]}
    return holding_pattern(
        load_scenario({"vehicles": {"count": 4}, "path": straight, "start": {"in_air": True}} | keys)
    )


def test_a_time_to_assemble_that_a_lap_outlasts_is_warned_of() -> None:
    """60 s from where the leader sets out to its first pass, plus a lap."""
    planned = {"vehicles": {"count": 4}, "path": {"waypoints_m": [[0, 0, 200], [9000, 0, 200]]}}
    min_s = math.ceil(60.0 + holding_pattern(load_scenario(planned)).lap_s)
    assert no_time_for_a_pattern(load_scenario(planned | {"start": {"timeout_s": min_s}})) is None
    said = no_time_for_a_pattern(load_scenario(planned | {"start": {"timeout_s": min_s - 2}})) or ""
    assert said.startswith(f"start.timeout_s: found {min_s - 2}; the leader's first pass comes 60 s after")
    assert said.endswith(f"; {min_s} or more wait")


@pytest.mark.parametrize(
    ("shape", "spacing_m", "needed_m"),
    [("line", 300, 22 / (6 / 300)), ("follower", 100, 300 / math.tan(math.radians(15.0)))],
)
def test_a_lap_is_little_larger_than_the_turn_that_the_widest_formation_can_keep(shape, spacing_m, needed_m) -> None:
    """The outer slot of a line may be 6 m/s faster than the leader; the last of a column flies 15 degrees aside."""
    count = 3 if shape == "line" else 4
    found = pattern_of(vehicles={"count": count}, formation={"shape": shape, "spacing_m": spacing_m})
    assert needed_m <= found.lap_radius_m < 1.3 * needed_m
    turned_m = 2 * math.pi * found.lap_radius_m
    assert found.lap_s == pytest.approx((turned_m + 2 * (660.0 - 44.0)) / 22.0 + 2.0, abs=0.5)


def test_aircraft_under_total_energy_control_are_asked_for_less_of_their_speed_in_a_lap() -> None:
    """Both may be 6 m/s slower than a leader at 20 m/s; equation (7) uses 0.8 of that, an ArduPlane 0.6."""
    path = {"speed_mps": 20, "waypoints_m": [[0, 0, 200], [9000, 0, 200]]}
    model = {"speed_min_mps": 14, "speed_max_mps": 29, "turn_rate_max_rps": 0.35}
    line = {"shape": "line", "spacing_m": 100}
    plain, plane = (
        pattern_of(vehicles={"count": 3, "model": each}, formation=line, path=path).lap_radius_m
        for each in (model, "arduplane")
    )
    assert plain == pytest.approx(100 * 20 / (0.8 * 6), rel=0.03)
    assert plane == pytest.approx(100 * 20 / (0.6 * 6), rel=0.03)


def test_no_formation_makes_the_leader_turn_gentler_than_half_a_degree_a_second() -> None:
    """At its highest speed no vehicle has any left for a turn."""
    fast = {"speed_mps": 28, "waypoints_m": [[0, 0, 200], [9000, 0, 200]]}
    assert pattern_of(path=fast).lap_radius_m == pytest.approx(28 / 0.01)


def test_telemetry_that_real_arduplanes_refuse_is_warned_of() -> None:
    """ArduPlane 4.7 denies intervals of 24.999 ms and accepts 25 ms; an emulated one accepts 20 ms."""
    path = {"waypoints_m": [[0, 0, 200], [9000, 0, 200]]}

    def warned(autopilot: str, rate_hz: float) -> str | None:
        vehicles = {"count": 2, "autopilot": autopilot}
        return refused_rate(load_scenario({"vehicles": vehicles, "telemetry": {"rate_hz": rate_hz}, "path": path}))

    assert warned("arduplane", 50.0) == (
        "telemetry.rate_hz: found 50; a real ArduPlane (vehicle 1, 2) refuses more than 40 with SCHED_LOOP_RATE 50, "
        "its default"
    )
    assert warned("arduplane", 40.0) is None
    assert warned("emulator", 50.0) is None


def test_slots_that_no_shape_of_the_flight_has_are_warned_of() -> None:
    keys = {"vehicles": {"count": 3}, "path": {"waypoints_m": [[0, 0, 200], [9000, 0, 200]]}}
    slots_m = {"slots_m": {2: [-30, 30, 0], 3: [-30, -30, 0]}}
    found = slots_of_no_shape(load_scenario(keys | {"formation": slots_m | {"shape": "line"}}))
    assert found == "formation.slots_m: found slots; shape line has its own, only custom has these"
    for formation in ({"shape": "custom"}, {"changes": [{"at_s": 20, "shape": "custom"}]}):
        assert slots_of_no_shape(load_scenario(keys | {"formation": slots_m | formation})) is None


def test_bursts_of_no_loss_are_warned_of() -> None:
    keys = {"vehicles": {"count": 3}, "path": PLAIN["path"], "links": {"default": {"mean_burst": 5}}}
    (told,) = [text for text in check_report(load_scenario(keys))["warnings"] if "mean_burst" in text]
    assert told.startswith("links: mean_burst: found 5 with a loss of 0 (vehicle 1), which does nothing")
    later = load_scenario(keys, ["links.changes=[{at_s: 9, vehicles: all, loss: 0.1}]"])
    assert not [text for text in check_report(later)["warnings"] if "mean_burst" in text]


def test_a_loop_that_is_unstable_without_delay_stands_nothing_else() -> None:
    keys = {"vehicles": {"count": 3}, "path": PLAIN["path"]}
    told = check_report(load_scenario(keys, ["law.fuzzy.base=0", "law.fuzzy.span=0"]))
    assert "loop x is unstable without any delay" in told["warnings"]
    assert (told["lag_margin"]["x"], told["mismatch_margin_lags_off_s"]["x"]) == (0.0, 0.0)
    assert not [text for text in told["warnings"] if text.startswith("loop x: at")]


def test_gains_that_are_unstable_around_the_aircraft_have_no_margin_though_equation_7_would_have_one() -> None:
    """ArduPlanes with the gains for noise never settle: 5 m along x in 180 s. By (7) alone the margin was 2.675 s."""
    keys = {"vehicles": {"count": 2, "model": "arduplane"}, "path": {"waypoints_m": [[0, 0, 150], [5000, 0, 150]]}}
    noise, auto = (load_scenario(keys | {"law": {"type": "pid", "gains": gains}}) for gains in ("noise", "auto"))
    told = check_report(noise)
    assert [text for text in told["warnings"] if text.startswith("law.speed: unstable around the aircraft")]
    assert told["delay_margin_s"]["x"] == told["delay_margin_worst_s"]["x"] == scenario_delay_margin(noise) == 0.0
    assert told["mismatch_margin_s"]["x"] == told["lag_margin"]["x"] == 0.0
    assert 0.0 < told["delay_margin_s"]["y"] < told["loop_delay_s"], "by (7) alone 0.617 s"
    assert min(check_report(auto)["delay_margin_s"].values()) > 1.0


def test_a_margin_of_nothing_has_no_sign() -> None:
    assert (_seconds(-0.0001), _seconds(-0.5)) == ("0.000", "-0.500")
