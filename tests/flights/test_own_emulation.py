"""Links, faults, the air, aircraft, navigation and emulated families from a file outside of the packages are flown."""

from __future__ import annotations

import json
import math
import runpy
import subprocess
import sys
from pathlib import Path
from typing import Any, get_args

import numpy as np
import pyarrow.parquet as pq
import pytest
import yaml

import gcs_formation
from formation_scenario import ScenarioError, load_scenario
from formation_scenario.registry import load_extensions
from formation_scenario.schema import scenario_schema
from formation_scenario.surroundings import FaultKind
from formation_scenario.vehicles import Family
from gcs_formation.record.run_directory import EVENTS, SCENARIO, TIMESERIES
from gcs_formation.studies.random_scenarios import draw
from sim_vehicles.autopilot.faults import OURS
from sim_vehicles.families import FAMILIES

EXAMPLES = Path(__file__).parents[2] / "examples" / "extensions"
ROUGH_AIR = EXAMPLES / "rough_air_disturbance.py"
KINDS = ("radio_link", "icing_fault", "thermal_disturbance", "skywalker_aircraft", "survey_navigation", "quiet_family")
HEAD = "from pydantic import BaseModel\nfrom gcs_formation.extend import *\nfrom sim_vehicles.families import Plane\n"


@pytest.fixture(scope="module")
def own(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """All examples of these kinds, in one file."""
    file = tmp_path_factory.mktemp("own") / "own.py"
    file.write_text("".join((EXAMPLES / f"{name}.py").read_text() for name in KINDS), encoding="utf-8")
    return file


def keys(**more: Any) -> dict[str, Any]:
    return {
        "name": "own",
        "duration_s": 6,
        "vehicles": [{"id": 1, "role": "leader"}, {"id": 2}, {"id": 3}],
        "start": {"in_air": True, "run_in_s": 7},
        "finish": {"loiter_s": 0.5},
        "formation": {"shape": "arrow", "spacing_m": 30},
        "path": {"waypoints_m": [[0, 0, 100], [2000, 0, 100], [4000, 0, 100]]},
        **more,
    }


ALL: dict[str, Any] = {
    "vehicles": [
        {"id": 1, "role": "leader"},
        {"id": 2, "navigation": {"source": "survey", "parameters": {"north_m": 3.0}}, "model": "skywalker"},
        {
            "id": 3,
            "emulator": {"family": "quiet", "parameters": {"text": "flying"}},
            "model": {"aircraft": "skywalker", "parameters": {"payload_kg": 0.5}, "tau_psi_s": 2.0},
        },
    ],
    "links": {"default": {"process": "radio", "parameters": {"range_m": 2000}}, "station_m": [0, 0, 3]},
    "disturbances": [{"kind": "thermal", "at_s": 1, "until_s": 5, "parameters": {"north_m": 60, "up_mps": 1.0}}],
    "faults": [{"kind": "icing", "at_s": 2, "until_s": 4, "vehicles": [3]}],
}


def flown(out: Path, plugin: Path, **more: Any) -> gcs_formation.Summary:
    return gcs_formation.run(keys(**more), clock="virtual", out=out, plugins=[plugin])


def events(run: Path, kind: str) -> list[dict[str, Any]]:
    found = [json.loads(line) for line in (run / EVENTS).read_text(encoding="utf-8").splitlines()]
    return [each for each in found if each["kind"] == kind]


@pytest.fixture(scope="module")
def flight(own, tmp_path_factory: pytest.TempPathFactory) -> tuple[Path, gcs_formation.Summary]:
    run = tmp_path_factory.mktemp("flight") / "run"
    return run, flown(run, own, **ALL)


def column(run: Path, name: str, vehicle: str) -> np.ndarray:
    found = pq.read_table(run / TIMESERIES)
    mine = [str(each) == vehicle for each in found["vehicle"].to_pylist()]
    return np.array(found[name].to_numpy(zero_copy_only=False))[mine]


def test_a_link_process_delays_by_what_it_returns(flight):
    _, summary = flight
    link = summary.figures["links"]["2"]
    assert 50 < link["injected_up_ms"] < 70
    assert 50 < link["measured_delay_ms"]["p50"] < 75


def test_a_disturbance_is_the_airs_velocity_where_the_vehicle_is(flight):
    run, _ = flight
    on_path = column(run, "phase", "1") == "flying"
    north_m, down_mps = (column(run, name, "1")[on_path] for name in ("true_north_m", "true_disturbance_down_mps"))
    nearest = int(np.argmin(np.abs(north_m - 60)))
    assert down_mps[nearest] == pytest.approx(-1.0, abs=0.01)
    assert not down_mps[north_m > 200].any()


def test_a_fault_limits_its_vehicle_says_so_and_ends(flight):
    run, _ = flight
    assert [(each["text"], each["vehicle"]) for each in events(run, "fault")] == [
        ("icing", "3"),
        ("icing is over", "3"),
    ]
    assert "ice on the wings" in [each["text"] for each in events(run, "statustext")]


def test_a_navigation_source_is_what_telemetry_says(flight):
    run, _ = flight
    off_m = column(run, "north_m", "2") - column(run, "true_north_m", "2")
    others_m = column(run, "north_m", "1") - column(run, "true_north_m", "1")
    assert np.nanmedian(off_m) - np.nanmedian(others_m) == pytest.approx(3.0, abs=0.3)


def test_an_aircraft_is_its_keys_and_those_given_beside_it_come_first(flight):
    run, _ = flight
    _, second, third = (
        each["model"] for each in yaml.safe_load((run / SCENARIO).read_text(encoding="utf-8"))["vehicles"]
    )
    assert (second["tau_v_s"], second["tau_psi_s"]) == (4.0, 1.2)
    assert (third["tau_v_s"], third["tau_psi_s"], third["parameters"]) == (4.5, 2.0, {"payload_kg": 0.5})


def test_an_emulated_family_is_a_subclass_of_ours(flight):
    run, _ = flight
    assert {each["vehicle"] for each in events(run, "statustext") if each["text"] == "flying"} == {"3"}


def test_its_record_names_them_and_flies_again_to_the_same_bytes(flight, own, tmp_path):
    run, summary = flight
    kinds = {"link process", "fault", "disturbance", "aircraft", "emulated family", "navigation source"}
    assert {each["kind"] for each in summary.figures["extensions"]} == kinds
    gcs_formation.run(run / SCENARIO, clock="virtual", out=tmp_path / "again", plugins=[own])
    assert (run / "flight.tlog").read_bytes() == (tmp_path / "again" / "flight.tlog").read_bytes()
    with pytest.raises(ScenarioError, match="it was flown with --plugin"):
        load_scenario(run / SCENARIO)


def test_a_radio_loses_what_is_beyond_its_range(own, tmp_path):
    links = {"changes": [{"at_s": 1, "vehicles": [3], "process": "radio", "parameters": {"range_m": 60}}]}
    summary = flown(tmp_path / "run", own, links=links, duration_s=8)
    lost = {name: link["injected_loss"] for name, link in summary.figures["links"].items()}
    assert lost["3"] > 0.05
    assert lost["1"] == lost["2"] == 0.0


@pytest.mark.slow
def test_a_program_injects_them_and_the_flight_repeats_without_it(own, tmp_path):
    with gcs_formation.Flight(keys(duration_s=5), out=tmp_path / "run", plugins=[own]) as flight:
        for tick in flight:
            if tick.number == 30:
                flight.inject("icing", vehicle=3, for_s=1.0, parameters={"share": 0.7})
                flight.disturb("thermal", vehicle=2, parameters={"north_m": 0})
                flight.link(2, process="radio")
                with pytest.raises(
                    ScenarioError, match=r"fault.kind: found 'icin'; allowed: .* \(did you mean 'icing'"
                ):
                    flight.inject("icin")
                with pytest.raises(ScenarioError, match=r"fault.parameters.shar: found an unknown key 'shar'"):
                    flight.inject("icing", parameters={"shar": 1})
    recorded = yaml.safe_load((tmp_path / "run" / SCENARIO).read_text(encoding="utf-8"))["orders"]
    assert [each["fault"]["parameters"] for each in recorded if "fault" in each] == [{"share": 0.7}]
    gcs_formation.run(tmp_path / "run" / SCENARIO, clock="virtual", out=tmp_path / "again", plugins=[own])
    assert (tmp_path / "run" / "flight.tlog").read_bytes() == (tmp_path / "again" / "flight.tlog").read_bytes()


FAILING: dict[str, tuple[str, dict[str, Any]]] = {
    "link process": (
        "@register_link_process('it')\nclass It(LinkProcess):\n    def delay_s(self, carried):\n        return {}\n",
        {"links": {"default": {"process": "it"}}},
    ),
    "fault": (
        "@register_fault('it')\nclass It(VehicleFault):\n    def measure(self, measured, time_s):\n"
        "        return measured._replace(north_m={})\n",
        {"faults": [{"kind": "it", "at_s": 0}]},
    ),
    "disturbance": (
        "@register_disturbance('it')\nclass It(AirDisturbance):\n    def velocity_mps(self, at):\n"
        "        return 0, {}, 0\n",
        {"disturbances": [{"kind": "it", "at_s": 0}]},
    ),
    "navigation source": (
        "@register_navigation('it')\nclass It(NavigationSource):\n    def measure(self, true, time_s):\n"
        "        return true._replace(north_m={})\n",
        {"vehicles": [{"id": 1, "role": "leader"}, {"id": 2, "navigation": {"source": "it"}}]},
    ),
    "emulated family": (
        "@register_emulated_family('it')\nclass It(Plane):\n    def follow_time(self):\n"
        "        0 if self.time_s < 5 else {}\n",
        {"vehicles": [{"id": 1, "role": "leader"}, {"id": 2, "emulator": {"family": "it"}}]},
    ),
}


def failure(tmp_path: Path, code: str, more: dict[str, Any]) -> str:
    (tmp_path / "own.py").write_text(HEAD + code, encoding="utf-8")
    two = {"vehicles": [{"id": 1, "role": "leader"}, {"id": 2}], "formation": {"shape": "follower"}}
    with pytest.raises(gcs_formation.RunAbortedError) as failed:
        flown(tmp_path / "run", tmp_path / "own.py", **two | more)
    return str(failed.value)


@pytest.mark.parametrize("kind", FAILING)
def test_an_error_of_one_ends_the_flight_with_its_file_and_line(kind, tmp_path):
    code, more = FAILING[kind]
    said = failure(tmp_path, code.format("1 / 0"), more)
    assert f"the {kind} 'it' failed: ZeroDivisionError: division by zero ({tmp_path / 'own.py'}, line 7)" in said
    assert [each["text"] for each in events(tmp_path / "run", "phase")][-2:] == ["loitering", "failed"]


@pytest.mark.parametrize("kind", [kind for kind in FAILING if kind != "emulated family"])
def test_what_is_not_finite_ends_the_flight(kind, tmp_path):
    code, more = FAILING[kind]
    said = failure(tmp_path, code.format("float('nan')"), more)
    assert f"the {kind} 'it' failed: " in said
    assert "nan" in said
    assert f"{tmp_path / 'own.py'}:4" in said


@pytest.mark.parametrize("kind", [kind for kind in FAILING if kind != "emulated family"])
def test_one_that_cannot_begin_ends_the_run(kind, tmp_path):
    code, more = FAILING[kind]
    said = failure(tmp_path, code.format(0) + "    def begin(self):\n        raise LookupError('no map')\n", more)
    assert f"{kind} 'it' can't begin: LookupError: no map ({tmp_path / 'own.py'}, line 9)" in said


@pytest.mark.slow
def test_the_emulators_alone_end_with_the_extensions_file_and_line(tmp_path):
    code, more = FAILING["emulated family"]
    (tmp_path / "own.py").write_text(HEAD + code.format("1 / 0"), encoding="utf-8")
    (tmp_path / "s.yaml").write_text(yaml.safe_dump(keys(**more)), encoding="utf-8")
    command = ["sim_vehicles", "s.yaml", "--plugin", "own.py", "--until", "20", "--quiet"]
    done = subprocess.run(
        [sys.executable, "-m", *command], cwd=tmp_path, capture_output=True, text=True, timeout=60, check=False
    )
    assert done.returncode == 3, done.stderr
    assert f"the emulated family 'it' failed: ZeroDivisionError: division by zero ({tmp_path / 'own.py'}" in done.stderr


@pytest.mark.parametrize(
    ("override", "said"),
    [
        (
            "faults=[{kind: icin, at_s: 1}]",
            "faults.0.kind: found 'icin'; allowed: crash, freeze",
        ),
        ("faults=[{kind: icin, at_s: 1}]", "(did you mean 'icing'?)"),
        ("faults=[{kind: icing, at_s: 1, parameters: {share: 2}}]", "faults.0.parameters.share: found 2; allowed: "),
        ("faults=[{kind: crash, at_s: 1, parameters: {a: 2}}]", "faults.0.parameters: found a mapping; allowed: none"),
        ("disturbances=[{kind: therml, at_s: 1}]", "disturbances.0.kind: found 'therml'; allowed: step, ramp, sine"),
        ("disturbances=[{kind: thermal, at_s: 1}]", "disturbances.0.parameters.north_m: not found; allowed: a number"),
        ("links.default.process=radi", "links.default.process: found 'radi'; allowed: none, radio (did you mean"),
        ("links.default.parameters={range_m: 3}", "links.default.parameters: found a mapping; allowed: none: beside"),
        ("links.changes=[{at_s: 1, process: radio, parameters: {rang: 3}}]", "unknown key 'rang'; allowed: range_m"),
        ("vehicles.1.navigation={source: surve}", "vehicles.1.navigation.source: found 'surve'; allowed: truth, noisy"),
        ("vehicles.1.navigation={source: survey, parameters: {x: 1}}", "navigation.parameters.x: found an unknown key"),
        ("vehicles.1.model=skywalkr", "px4_copter; an extension's: skywalker (did you mean"),
        ("vehicles.1.model={aircraft: skywalke}", "vehicles.1.model.aircraft: found 'skywalke'; allowed: skywalker"),
        ("vehicles.1.model={aircraft: skywalker, parameters: {payload: 1}}", "found an unknown key 'payload'"),
        ("vehicles.1.emulator={family: loud}", "vehicles.1.emulator.family: found 'loud'; allowed: "),
        (
            "vehicles.1={id: 2, emulator: {family: quiet}, model: {firmware: px4}}",
            "vehicles.1.emulator.family: found 'quiet', which emulates arduplane; allowed: one that emulates px4_plane",
        ),
    ],
)
def test_names_and_keys_are_refused_as_all_others_are(override, said, own):
    with pytest.raises(ScenarioError) as refused:
        load_scenario(keys(), [override], plugins=[own])
    assert said in str(refused.value)


@pytest.mark.parametrize(
    ("code", "said"),
    [
        ("        return {'tau_v_s': -1}", ":4: tau_v_s: found -1; allowed: "),
        ("        return {'tau_w_s': 1}", ":4: tau_w_s: found an unknown key 'tau_w_s'"),
        ("        return 3", "aircraft 'it': found 3 ("),
        ("        raise LookupError('no polar')", "aircraft 'it': LookupError: no polar ("),
    ],
)
def test_an_aircraft_whose_model_is_not_allowed_is_refused(code, said, tmp_path):
    file = tmp_path / "own.py"
    file.write_text(f"{HEAD}@register_aircraft('it')\nclass It(Aircraft):\n    def model(self):\n{code}\n")
    with pytest.raises(ScenarioError) as refused:
        load_scenario(keys(), ["vehicles.1.model=it"], plugins=[file])
    assert said in str(refused.value)


def test_a_family_is_a_subclass_of_ours_and_names_of_ours_are_taken(tmp_path):
    for code, said in (
        ("@register_emulated_family('it')\nclass It:\n    pass\n", "a subclass of one of sim_vehicles.families"),
        ("@register_fault('crash')\nclass It(VehicleFault):\n    pass\n", "fault 'crash': found twice: gcs_formation"),
        ("@register_aircraft('arduplane')\nclass It(Aircraft):\n    pass\n", "aircraft 'arduplane': found twice"),
    ):
        (tmp_path / "own.py").write_text(HEAD + code)
        with pytest.raises(ScenarioError, match=said):
            load_extensions([tmp_path / "own.py"])


def test_ours_are_registered_by_the_same_functions():
    assert tuple(OURS) == ("crash", "freeze", "ignore", "restart", "pilot", "telemetry")
    assert set(OURS) == set(get_args(FaultKind))
    assert set(FAMILIES) == set(get_args(Family))
    assert all(entry.made.emulates == name for name, entry in FAMILIES.items())


def test_the_schema_has_their_names_and_keys(own):
    groups = scenario_schema(load_extensions([own]))["$defs"]
    assert "icing" in groups["Fault"]["properties"]["kind"]["enum"]
    assert groups["OwnDisturbance"]["properties"]["kind"]["enum"] == ["thermal"]
    assert groups["OwnNavigation"]["properties"]["source"]["enum"] == ["survey"]
    assert "OwnDisturbance" not in scenario_schema()["$defs"]


def test_stress_draws_the_faults_of_extensions(own):
    registry = load_extensions([own])
    drawn = {fault.kind for seed in range(1, 25) for fault in draw(seed, registry=registry).faults}
    assert "icing" in drawn
    assert drawn & {"crash", "freeze", "restart", "ignore", "pilot"}


def test_rough_air_is_as_that_of_ardu_pilots_simulator() -> None:
    """SIM_WIND_TURB 1: each of 1200 steps a second keeps 0.98 of the last; standard deviation 1 m/s."""
    found: Any = runpy.run_path(str(ROUGH_AIR))["RoughAir"]
    air = found.__new__(found)
    air.keys, air.random, air.dt_s = found.Keys(), np.random.default_rng(1), 0.02
    down_mps = np.array([air.velocity_mps(None)[2] for _ in range(20_000)])
    assert down_mps.std() == pytest.approx(10.0 * 0.02 / math.sqrt(1.0 - 0.98**2), rel=0.03)
    assert (down_mps[1:] * down_mps[:-1]).mean() == pytest.approx(0.98 ** (1200 * 0.02), abs=0.03)
