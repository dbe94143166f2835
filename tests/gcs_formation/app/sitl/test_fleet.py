"""Simulators of a scenario's vehicles: which program, where, and with what parameters."""

from __future__ import annotations

import socket
import sys
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from airlink.endpoint import VehicleId
from formation_scenario import Scenario, ScenarioError, load_scenario
from gcs_formation.app.sitl.fleet import ProgramError, Simulated, programs_of, simulated
from tests.flights.conftest import scenario

PLANES = {"count": 2, "autopilot": "arduplane"}
PORTS = ["udpin:127.0.0.1:14561", "udpin:0.0.0.0:14562"]
PROGRAM = Path(sys.executable)
PX4_PATH = {"speed_mps": 14, "waypoints_m": [[0, 0, 60], [2000, 0, 60], [4000, 0, 60]]}


def planned(family: str = "arduplane", **keys: Any) -> Scenario:
    each = [
        {"id": 1 + i, "autopilot": family, "endpoint": port, "role": "follower" if i else "leader"}
        for i, port in enumerate(PORTS)
    ]
    return load_scenario(scenario(**({"start": {"in_air": False}, "vehicles": each} | keys)))


def fleet(family: str = "arduplane", speedup: float = 1.0, *, stepped: bool = False, **keys: Any) -> list[Simulated]:
    return simulated({family: PROGRAM}, planned(family, **keys), speedup, stepped=stepped)


def px4(tmp_path: Path) -> Path:
    (tmp_path / "etc").mkdir()
    (tmp_path / "bin").mkdir()
    (program := tmp_path / "bin" / "px4").touch(0o755)
    return program


def test_an_ardu_plane_is_started_as_its_documents_say(tmp_path: Path) -> None:
    one, other = fleet(speedup=3.0)
    launch = other.simulator.launch(other.program, other.craft)
    assert launch.command[:5] == [str(PROGRAM), "--model", "plane", "--speedup", "3"]
    assert {"-I42", "udpclient:127.0.0.1:14562", "set.parm"} <= set(launch.command)
    assert launch.command[launch.command.index("--sysid") + 1] == "2"
    assert one.simulator.launch(one.program, one.craft).command[-5] == "udpclient:127.0.0.1:14561"


def test_vehicles_begin_where_emulated_ones_would_and_face_along_the_path() -> None:
    path = {"speed_mps": 22, "waypoints_m": [[0, 0, 100], [0, 1500, 100], [0, 3000, 100]]}
    origin = {"lat_deg": 35.0, "lon_deg": 125.0, "alt_m": 500.0}
    one, other = fleet(path=path, origin=origin, start={"in_air": False, "run_in_s": 30})
    home = one.craft.home
    assert (home.lat_deg, home.alt_m, home.heading_deg) == pytest.approx((35.0, 500.0, 90.0), abs=1e-6)
    assert home.lon_deg < 125.0 - 0.006  # 660 m of run-in, to the west
    apart_m = np.hypot(other.craft.home.lat_deg - home.lat_deg, other.craft.home.lon_deg - home.lon_deg) * 1e5
    assert apart_m > 15.0


def test_parameters_have_the_failsafes_on_and_the_scenarios_speed_wind_and_own_ones_last() -> None:
    one = fleet(wind={"velocity_mps": [-3.0, 0.0, 0.0]})[0]
    found = one.craft.parameters
    assert (found["FS_GCS_ENABL"], found["FS_LONG_ACTN"], found["AIRSPEED_CRUISE"]) == (1, 1, 22)
    assert found["SIM_WIND_SPD"] == 3.0
    assert found["SIM_WIND_DIR"] == 0.0  # it comes from the north
    given = {"FS_LONG_TIMEOUT": 20, "FS_LONG_ACTN": 5}
    vehicles = {"count": 1, "autopilot": "arduplane", "endpoint": PORTS[0], "autopilot_parameters": given}
    own = fleet(vehicles=vehicles)[0].craft.parameters
    assert (own["FS_LONG_TIMEOUT"], own["FS_LONG_ACTN"], own["FS_GCS_ENABL"]) == (20, 5, 1)


@pytest.mark.parametrize(
    ("family", "name", "of_an_hour"), [("arducopter", "BATT_CAPACITY", 30000.0), ("px4", "SIM_BAT_DRAIN", 3600.0)]
)
def test_batteries_last_for_twice_the_flight(family: str, name: str, of_an_hour: float) -> None:
    """By its default an ArduCopter's lasts for 400 s, and all were sent home before the end of the shipped scenario."""
    path = {"speed_mps": 5, "waypoints_m": [[0, 0, 60], [2000, 0, 60], [4000, 0, 60]]}
    model = {"px4": "px4_copter"}.get(family, family)
    ports = PORTS if family == "arducopter" else ["udpin:127.0.0.1:14550"] * 2
    each = [{"id": 1 + i, "autopilot": family, "model": model, "endpoint": port} for i, port in enumerate(ports)]
    each[0]["role"] = "leader"
    one = fleet(family, vehicles=each, path=path, duration_s=150)[0]
    assert one.craft.parameters[name] == pytest.approx(of_an_hour * 2.0 * (150.0 + 1200.0) / 3600.0)


def test_a_px4_is_known_by_its_instance(tmp_path: Path) -> None:
    vehicles = {"count": 2, "autopilot": "px4", "endpoint": "udpin:127.0.0.1:14550"}
    program = programs_of((f"px4={px4(tmp_path)}",))
    other = simulated(program, planned("px4", vehicles=vehicles, path=PX4_PATH), 2.0)[1]
    launch = other.simulator.launch(other.program, other.craft)
    assert launch.command[1:] == ["-i", "1", "-d", str(tmp_path / "etc")]
    assert launch.variables["PX4_SIM_MODEL"] == "sihsim_airplane"
    assert launch.variables["PX4_SIM_SPEED_FACTOR"] == "2"
    assert launch.variables["PX4_PARAM_FW_AIRSPD_TRIM"] == "14"
    assert other.simulator.ports(other.craft) == ((socket.SOCK_DGRAM, 18571),)
    assert other.identity == VehicleId(1, 2)


@pytest.mark.parametrize(
    ("keys", "words"),
    [
        ({"start": {"in_air": True}}, "start.in_air: found true with --sitl"),
        ({"vehicles": {"count": 2}}, "found emulator with --sitl arduplane=…"),
        ({"vehicles": PLANES | {"endpoint": "tcp:127.0.0.1:5762"}}, "one udpin:HOST:PORT"),
        ({"vehicles": PLANES | {"endpoint": PORTS}}, "one udpin:HOST:PORT"),
    ],
)
def test_what_can_not_be_simulated_is_refused_with_its_key(keys: dict[str, Any], words: str) -> None:
    with pytest.raises(ScenarioError, match=words.replace("…", ".")):
        fleet(**keys)


@pytest.mark.parametrize(
    ("given", "words"),
    [
        (("arduplane",), "allowed: FAMILY=PROGRAM, with FAMILY one of arducopter, arduplane, px4"),
        (("rover=/bin/sh",), "found 'rover=/bin/sh'"),
        (("arduplane=/nowhere",), "found no program /nowhere"),
        (("px4=/bin/sh",), "found no directory /etc, which|found no directory"),
        (("arduplane=/bin/sh", "arduplane=/bin/sh"), "found arduplane twice"),
    ],
)
def test_programs_that_can_not_be_used_are_named(given: tuple[str, ...], words: str) -> None:
    if "px4" in given[0] and Path("/etc").is_dir():
        given, words = (f"px4={PROGRAM}",), "found no directory"
    with pytest.raises(ProgramError, match=words):
        programs_of(given)
