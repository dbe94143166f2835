"""Vehicles that `sim-vehicles SCENARIO` starts are set up as the station asks of real ones."""

from pathlib import Path

import pytest

from formation_scenario import ScenarioError, load_scenario
from gcs_formation.from_scenario import autopilot_for
from sim_vehicles.cli.fly import PREPARED, prepare
from sim_vehicles.config import fleet_config
from sim_vehicles.fleet import Fleet

CONFIGS = Path(__file__).parents[2] / "configs"


def findings(name, values):
    scenario = load_scenario(CONFIGS / f"{name}.yaml")
    for planned, vehicle in zip(scenario.vehicles, Fleet(fleet_config(scenario)).vehicles, strict=True):
        vehicle.parameters.prepare(values)
        read = {name: value for name, _, value in vehicle.parameters.entries()}
        checks = autopilot_for(planned, scenario).checks(planned.model, scenario.path)
        assert all(set(check.all_names) & set(read) for check in checks)
        yield from filter(None, (check.finding(read) for check in checks))


@pytest.mark.parametrize("name", ["quickstart", "arduplane", "arducopter", "px4", "px4_copter"])
def test_the_station_finds_nothing_to_doubt_in_the_parameters_of_a_shipped_scenarios_vehicles(name):
    assert list(findings(name, {}))  # out of the box their failsafes are off, as real ones' are
    assert list(findings(name, PREPARED)) == []


@pytest.mark.parametrize("given", [None, {"FS_GCS_ENABL": 1, "FS_LONG_ACTN": 1, "SERVO_1": 3.5}])
def test_parameters_that_a_scenario_gives_are_those_that_a_vehicle_is_switched_on_with(given):
    path = {"speed_mps": 22, "waypoints_m": [[0, 0, 100], [2000, 0, 100]]}
    vehicles = {"count": 1} if given is None else {"count": 1, "autopilot_parameters": given}
    (vehicle,) = Fleet(fleet_config(load_scenario({"vehicles": vehicles, "path": path}))).vehicles
    prepare(vehicle)
    read = {name: value for name, _, value in vehicle.parameters.entries()}
    assert read["FS_LONG_TIMEOUT"] == (PREPARED["FS_LONG_TIMEOUT"] if given is None else 5.0)
    assert {name: read.get(name) for name in given or {}} == (given or {})


@pytest.mark.parametrize("name", ["fs_gcs", "A" * 17, "1A", "A B"])
def test_a_name_that_no_parameter_has_is_refused(name):
    path = {"speed_mps": 22, "waypoints_m": [[0, 0, 100], [2000, 0, 100]]}
    with pytest.raises(ScenarioError, match=f"vehicles.autopilot_parameters.{name}"):
        load_scenario({"vehicles": {"count": 1, "autopilot_parameters": {name: 1}}, "path": path})
