from pathlib import Path

import numpy as np
import pytest

from flight_model.spline import SplinePath
from formation_scenario import dump_scenario, load_scenario
from formation_scenario.slot_assignment import slot_table
from formation_scenario.source import read_text

CONFIGS = Path(__file__).parents[2] / "configs"


@pytest.mark.parametrize("path", sorted(CONFIGS.glob("*.yaml")), ids=lambda path: path.stem)
def test_every_shipped_scenario_loads_and_round_trips(path):
    scenario = load_scenario(path)
    assert load_scenario(read_text(dump_scenario(scenario)).data) == scenario


def test_the_papers_path_is_as_hard_as_the_paper_says():
    scenario = load_scenario(CONFIGS / "paper.yaml")
    path = SplinePath(scenario.path.waypoints_m)
    points = path.at(np.arange(0.0, path.length_m, 2.0))
    assert path.length_m > 22_700.0
    assert 1.4 < np.degrees(22 * np.abs(points.curvature_1pm)).max() <= 1.6
    assert 1.0 < (22 * np.abs(points.slope)).max() <= 1.2
    assert np.abs(points.height_m - 200.0).max() <= 40.0


def test_the_papers_slots():
    slots = slot_table(load_scenario(CONFIGS / "paper.yaml"))
    x_rc, y_rc = -slots[:, 0], -slots[:, 1]  # leader minus follower
    assert list(zip(x_rc, y_rc, strict=True)) == [(30.0, 30.0), (30.0, -30.0), (60.0, 0.0)]


def test_the_quickstart_has_a_port_for_each_vehicle_and_path_for_its_time():
    scenario = load_scenario(CONFIGS / "quickstart.yaml")
    ports = [vehicle.endpoint for vehicle in scenario.vehicles]
    assert ports == [f"udpin:127.0.0.1:{port}" for port in range(14551, 14555)]
    length_m = SplinePath(scenario.path.waypoints_m).length_m
    assert length_m > max(3000.0, scenario.duration_s * scenario.path.begin_mps)


@pytest.mark.parametrize("shape", ["arrow", "square", "echelon", "line", "triangle", "plus", "circle", "follower"])
@pytest.mark.parametrize("name", ["quickstart", "paper"])
def test_the_shapes_that_the_comments_offer_can_be_flown(name, shape):
    scenario = load_scenario(CONFIGS / f"{name}.yaml", [f"formation.shape={shape}"])
    assert scenario.formation.shape == shape
