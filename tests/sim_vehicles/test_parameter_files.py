"""Emulated vehicles answer with the parameters of a file, under the names of its version, and fly by them."""

from __future__ import annotations

import math
from pathlib import Path

import pytest
import yaml

from airlink import mavlink as m
from airlink.endpoint import Address
from airlink.messages.command import ParamRequestRead, ParamValue
from formation_scenario import load_scenario
from formation_scenario.parameter_files import Parameter
from sim_vehicles.autopilot.missions import Sender
from sim_vehicles.autopilot.parameters import ParameterServer
from sim_vehicles.config import VehicleConfig, fleet_config
from sim_vehicles.families.arduplane.plane_parameters import plane_parameters
from sim_vehicles.families.px4.services import Px4Parameters, parameters

ASKS = Sender(Address("127.0.0.1", 14550), 255, 190)
OLD = "ARSPD_FBW_MIN 12\nARSPD_FBW_MAX 24.5\nTRIM_ARSPD_CM 1700\nLIM_ROLL_CD 3500\nSYSID_THISMAV 9\nLOG_BITMASK 65535\n"
PX4 = "1\t1\tFW_AIRSPD_MIN\t12\t9\n1\t1\tFW_AIRSPD_MAX\t22\t9\n1\t1\tNAV_DLL_ACT\t2\t6\n1\t1\tSYS_AUTOSTART\t2100\t6\n"


def configured(directory: Path, text: str) -> VehicleConfig:
    (directory / "plane.parm").write_text(text, encoding="utf-8")
    vehicles = [{"id": 3, "role": "leader", "model": {"parameters": "plane.parm"}}]
    plain = {"vehicles": vehicles, "path": {"speed_mps": 17, "waypoints_m": [[0, 0, 100], [4000, 0, 100]]}}
    (directory / "scenario.yaml").write_text(yaml.safe_dump(plain), encoding="utf-8")
    return fleet_config(load_scenario(directory / "scenario.yaml")).vehicles[0]


def answer(server: ParameterServer, name: str) -> ParamValue | None:
    found = server.answers(ParamRequestRead(3, 1, name), ASKS)
    return found[0] if found and isinstance(found[0], ParamValue) else None


def test_an_arduplane_answers_with_its_file_under_the_names_that_it_has(tmp_path: Path) -> None:
    server = plane_parameters(configured(tmp_path, OLD), 17.0)
    answers = {name: answer(server, name) for name in ("TRIM_ARSPD_CM", "LIM_ROLL_CD", "LOG_BITMASK", "ARSPD_FBW_MAX")}
    assert {name: each.param_value for name, each in answers.items() if each} == {
        "TRIM_ARSPD_CM": 1700.0,
        "LIM_ROLL_CD": 3500.0,
        "LOG_BITMASK": 65535.0,
        "ARSPD_FBW_MAX": 24.5,
    }
    assert [answer(server, name) for name in ("AIRSPEED_MIN", "AIRSPEED_CRUISE", "ROLL_LIMIT_DEG")] == [None] * 3


def test_it_flies_by_them_whatever_they_are_called(tmp_path: Path) -> None:
    server = plane_parameters(configured(tmp_path, OLD), 17.0)
    assert (server["AIRSPEED_MIN"], server["AIRSPEED_MAX"], server["AIRSPEED_CRUISE"]) == (12.0, 24.5, 17.0)
    assert server.is_airspeed(24.4)
    assert not server.is_airspeed(11.9)


def test_its_system_id_is_its_own(tmp_path: Path) -> None:
    own = answer(plane_parameters(configured(tmp_path, OLD), 17.0), "SYSID_THISMAV")
    assert own is not None
    assert own.param_value == 3.0


def test_every_parameter_of_the_file_is_in_its_list(tmp_path: Path) -> None:
    names = {name for name, _, _ in plane_parameters(configured(tmp_path, OLD), 17.0).entries()}
    assert {"LOG_BITMASK", "TRIM_ARSPD_CM", "FS_LONG_ACTN"} <= names
    assert "AIRSPEED_CRUISE" not in names


def test_without_a_file_they_are_the_present_versions() -> None:
    server = plane_parameters(configured_plain(), 17.0)
    assert answer(server, "AIRSPEED_MIN") is not None
    assert answer(server, "ARSPD_FBW_MIN") is None


def configured_plain() -> VehicleConfig:
    plain = {"vehicles": {"count": 1}, "path": {"waypoints_m": [[0, 0, 100], [4000, 0, 100]]}}
    return fleet_config(load_scenario(plain)).vehicles[0]


def test_a_px4_answers_with_its_files_types(tmp_path: Path) -> None:
    config = configured(tmp_path, PX4)
    server = Px4Parameters(parameters(config, 17.0))
    assert config.family == "px4_plane"
    kinds = {name: (kind, value) for name, kind, value in server.entries()}
    assert kinds["SYS_AUTOSTART"] == (m.MAV_PARAM_TYPE_INT32, 2100.0)
    assert kinds["NAV_DLL_ACT"] == (m.MAV_PARAM_TYPE_INT32, 2.0)
    assert server["AIRSPEED_MIN"] == 12.0
    assert kinds["MAV_SYS_ID"][1] == 3.0


@pytest.mark.parametrize("value", [16.5, 16.0])
def test_a_whole_parameter_with_a_fraction_in_the_file_is_a_float(value: float) -> None:
    config = configured_plain()
    server = plane_parameters(
        VehicleConfig(config.identity, config.endpoint, config.start, parameters={"AIRSPEED_MIN": Parameter(value, 1)}),
        17.0,
    )
    found = answer(server, "AIRSPEED_MIN")
    assert found is not None
    assert found.param_value == value
    assert (found.param_type == m.MAV_PARAM_TYPE_REAL32) == (math.floor(value) != value)
