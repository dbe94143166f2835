"""Vehicles that `sim-vehicles SCENARIO` starts are set up as the station asks of real ones."""

from pathlib import Path

import pytest

from formation_scenario import load_scenario
from gcs_formation.from_scenario import autopilot_for
from sim_vehicles.cli.fly import PREPARED
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
        yield from filter(None, (check.judge(read) for check in checks))


@pytest.mark.parametrize("name", ["quickstart", "arduplane", "arducopter", "px4", "px4_copter"])
def test_the_station_finds_nothing_to_doubt_in_the_parameters_of_a_shipped_scenarios_vehicles(name):
    assert list(findings(name, {}))  # out of the box their failsafes are off, as real ones' are
    assert list(findings(name, PREPARED)) == []
