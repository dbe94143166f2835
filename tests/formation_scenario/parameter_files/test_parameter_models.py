"""What becomes of a parameter file: limits and time constants, by old and new names, and what is refused."""

from __future__ import annotations

import math
from pathlib import Path
from typing import Any

import pytest
import yaml

from flight_model.energy import GRAVITY_MPS2, steepest_climb_mps
from formation_scenario import Scenario, ScenarioError, dump_scenario, load_scenario
from formation_scenario.parameter_files import ParameterModel, model_of
from formation_scenario.parameter_files.text import parse
from formation_scenario.vehicle_files import shipped_models
from formation_scenario.vehicles import VehicleModel

NEW = """\
AIRSPEED_MIN 12
AIRSPEED_MAX 24
AIRSPEED_CRUISE 17
ROLL_LIMIT_DEG 35
PTCH_LIM_MAX_DEG 18
PTCH_LIM_MIN_DEG -22
TECS_CLMB_MAX 4
TECS_SINK_MAX 3.5
TECS_SINK_MIN 1.5
TECS_TIME_CONST 6
TECS_PITCH_MAX 0
RLL2SRV_TCONST 0.45
TRIM_THROTTLE 40
THR_SLEWRATE 0
NAVL1_PERIOD 17
LOG_BITMASK 65535
"""
RENAMED = {
    "AIRSPEED_MIN 12": "ARSPD_FBW_MIN 12",
    "AIRSPEED_MAX 24": "ARSPD_FBW_MAX 24",
    "AIRSPEED_CRUISE 17": "TRIM_ARSPD_CM 1700",
    "ROLL_LIMIT_DEG 35": "LIM_ROLL_CD 3500",
    "PTCH_LIM_MAX_DEG 18": "LIM_PITCH_MAX 1800",
    "PTCH_LIM_MIN_DEG -22": "LIM_PITCH_MIN -2200",
}
PX4 = "1\t1\tFW_AIRSPD_MIN\t12\t9\n1\t1\tFW_AIRSPD_MAX\t22\t9\n1\t1\tFW_R_LIM\t40\t9\n1\t1\tFW_T_CLMB_R_SP\t2.5\t9\n"


def made(text: str) -> ParameterModel:
    return model_of(parse(text, "plane.parm"), shipped_models())


def model(text: str) -> VehicleModel:
    return VehicleModel.model_validate(dict(made(text).model))


def old(text: str) -> str:
    for now, before in RENAMED.items():
        text = text.replace(now, before)
    return text


def scenario(directory: Path, text: str, **vehicle: Any) -> Scenario:
    (directory / "plane.parm").write_text(text, encoding="utf-8")
    vehicles = [{"id": 1, "role": "leader", "model": {"parameters": "plane.parm"}} | vehicle]
    plain = {"vehicles": vehicles, "path": {"speed_mps": 17, "waypoints_m": [[0, 0, 100], [4000, 0, 100]]}}
    (directory / "scenario.yaml").write_text(yaml.safe_dump(plain), encoding="utf-8")
    return load_scenario(directory / "scenario.yaml")


def test_an_arduplanes_parameters_are_its_limits() -> None:
    found = model(NEW)
    assert (found.speed_min_mps, found.speed_max_mps, found.climb_max_mps) == (12.0, 24.0, 3.5)
    by_bank = GRAVITY_MPS2 * math.tan(math.radians(35.0)) / 24.0
    assert found.turn_rate_max_rps == pytest.approx(min(by_bank, 1.0 / found.tau_psi_s), rel=1e-4)
    frame = found.airframe
    assert frame is not None
    assert (frame.bank_max_deg, frame.pitch_max_deg, frame.pitch_min_deg) == (35.0, 18.0, -22.0)
    assert (frame.airspeed_cruise_mps, frame.time_constant_s, frame.bank_lag_s) == (17.0, 6.0, 0.45)
    assert (frame.throttle_cruise, frame.throttle_slew_per_s) == (0.4, 10.0)  # 0: no limit


def test_older_names_and_units_give_the_same() -> None:
    assert made(old(NEW)).model == made(NEW).model
    assert "LIM_ROLL_CD" in made(old(NEW)).taken


def test_what_the_file_lacks_is_the_firmwares_default_and_said() -> None:
    found = made("AIRSPEED_MIN 10\n")
    assert found.model["speed_max_mps"] == 22.0
    assert found.defaults["AIRSPEED_MAX"] == 22.0
    assert found.defaults["ROLL_LIMIT_DEG"] == 45.0
    assert found.taken == {"AIRSPEED_MIN": "speed_min_mps"}


def test_what_isnt_taken_is_named_if_it_concerns_flight_and_counted_else() -> None:
    found = made(NEW)
    assert found.left == ["NAVL1_PERIOD"]
    assert found.others == 1


@pytest.mark.parametrize("climb_mps", [2, 5, 15])
@pytest.mark.parametrize(("cruise", "fastest"), [(12, 20), (22, 30), (40, 65)])
def test_the_emulated_aircraft_flies_its_greatest_airspeed_and_climb(climb_mps: int, cruise: int, fastest: int) -> None:
    speeds = f"AIRSPEED_MIN 10\nAIRSPEED_CRUISE {cruise}\nAIRSPEED_MAX {fastest}\n"
    frame = model(f"{speeds}TECS_CLMB_MAX {climb_mps}\n").airframe
    assert frame is not None
    p = frame.parameters()
    assert steepest_climb_mps(p) > climb_mps
    assert p.thrust_mps2 > p.drag_mps2 * (fastest / 22.0) ** 2


def test_a_px4s_parameters_are_its_limits() -> None:
    found = made(PX4)
    assert (found.firmware, found.model["firmware"]) == ("px4", "px4")
    its = VehicleModel.model_validate(dict(found.model))
    assert (its.speed_min_mps, its.speed_max_mps) == (12.0, 22.0)
    assert its.climb_max_mps == 2.0  # FW_T_SINK_R_SP's default, below FW_T_CLMB_R_SP
    assert its.turn_rate_max_rps == pytest.approx(GRAVITY_MPS2 * math.tan(math.radians(40.0)) / 22.0, rel=1e-4)
    slower = VehicleModel.model_validate(dict(made(f"{PX4}FW_T_ALT_TC 10\nNPFG_PERIOD 20\n").model))
    assert slower.tau_hb_s == pytest.approx(2.0 * its.tau_hb_s)
    assert slower.tau_psi_s == pytest.approx(2.0 * its.tau_psi_s)


def test_a_scenario_flies_by_it_and_its_own_keys_win(tmp_path: Path) -> None:
    own = {"parameters": "plane.parm", "speed_max_mps": 21, "airframe": {"bank_lag_s": 0.3}}
    found = scenario(tmp_path, NEW, model=own)
    its = found.vehicles[0].model
    assert its.airframe is not None
    assert (its.speed_min_mps, its.speed_max_mps, its.airframe.bank_lag_s) == (12.0, 21.0, 0.3)
    assert its.airframe.bank_max_deg == 35.0
    assert its.parameters == str(tmp_path / "plane.parm")
    assert found.law.gains == "auto"
    assert load_scenario(yaml.safe_load(dump_scenario(found))) == found


@pytest.mark.parametrize(
    ("text", "said"),
    [
        ("AIRSPEED_MIN 12\nRLL2SRV_TCONST 99\n", "line 2: RLL2SRV_TCONST: found 99; allowed: 0.04 to 5"),
        ("TRIM_ARSPD_CM 1e6\n", "line 1: TRIM_ARSPD_CM: found 1e+06; allowed: 500 to 10000"),
        ("AIRSPEED_MIN 25\nAIRSPEED_MAX 20\n", "line 2: AIRSPEED_MAX: found 20; allowed: airspeeds of which"),
        ("WPNAV_SPEED 500\n", "found no airspeed; allowed: a fixed wing's: AIRSPEED_MIN, ARSPD_FBW_MIN, FW_"),
    ],
)
def test_a_file_that_cant_be_flown_is_refused_with_its_line_and_the_scenarios(
    tmp_path: Path, text: str, said: str
) -> None:
    with pytest.raises(ScenarioError) as refused:
        scenario(tmp_path, text)
    (problem,) = refused.value.problems
    assert problem.key == "vehicles.0.model.parameters"
    assert said in f"{problem.found}; allowed: {problem.allowed}"


def test_what_names_no_file_is_refused(tmp_path: Path) -> None:
    with pytest.raises(ScenarioError, match="found 5; allowed: the name of a parameter file, or beside aircraft"):
        scenario(tmp_path, NEW, model={"parameters": 5})


def test_a_file_that_isnt_there_is_refused(tmp_path: Path) -> None:
    with pytest.raises(ScenarioError, match="No such file"):
        scenario(tmp_path, NEW, model={"parameters": "other.parm"})


def test_a_vehicle_file_names_one_relative_to_itself(tmp_path: Path) -> None:
    (tmp_path / "planes").mkdir()
    (tmp_path / "planes" / "plane.parm").write_text(NEW, encoding="utf-8")
    own = {"schema": 1, "name": "mine", "model": {"parameters": "plane.parm", "climb_max_mps": 2}}
    (tmp_path / "planes" / "mine.yaml").write_text(yaml.safe_dump(own), encoding="utf-8")
    its = scenario(tmp_path, NEW, model="planes/mine.yaml").vehicles[0].model
    assert (its.speed_min_mps, its.climb_max_mps) == (12.0, 2.0)
    assert its.parameters == str(tmp_path / "planes" / "plane.parm")


@pytest.mark.parametrize(("text", "autopilot", "allowed"), [(NEW, "px4", "px4"), (PX4, "arduplane", "ardupilot")])
def test_parameters_of_another_autopilot_are_refused(tmp_path: Path, text: str, autopilot: str, allowed: str) -> None:
    with pytest.raises(ScenarioError, match=f"for an {autopilot}; allowed: one of {allowed}"):
        scenario(tmp_path, text, autopilot=autopilot)
