"""A scenario's vehicles, seen from the other end of their links."""

import math

import pytest

from airlink.endpoint import VehicleId
from formation_scenario import load_scenario
from formation_scenario.navigation import NoisyNavigation
from formation_scenario.vehicles import VehicleClock
from sim_vehicles.config import fleet_config
from sim_vehicles.fleet import Fleet

SCENARIO = """
schema: 1
name: pair
duration_s: 60
origin: {lat_deg: 47.5, lon_deg: 8.5, alt_m: 400}
start: {in_air: true}
vehicles:
  - {id: 1, role: leader, endpoint: "udpin:0.0.0.0:14561", clock: {offset_s: 2.5, drift_ppm: 15000}}
  - {id: 2, role: follower, endpoint: "udpout:10.0.0.7:14562", model: {tau_v_s: 5.0}}
formation: {shape: custom, spacing_m: 30, frame: leader_heading, slots_m: {2: [-30, 30, 0]}}
path: {speed_mps: 21, waypoints_m: [[0, 0, 100], [1500, 0, 100], [3000, 0, 100]]}
wind: {velocity_mps: [1, 2, 0]}
disturbances: [{at_s: 20, vehicles: all, velocity_mps: [0.6, 0.6, 0.0]}]
faults: [{at_s: 30, vehicles: [2], kind: crash}]
"""


@pytest.fixture
def config(tmp_path):
    path = tmp_path / "pair.yaml"
    path.write_text(SCENARIO)
    return fleet_config(load_scenario(path))


def test_a_vehicle_talks_to_where_the_ground_station_listens_and_listens_where_it_talks_to(config):
    assert [str(vehicle.endpoint) for vehicle in config.vehicles] == ["udpout:127.0.0.1:14561", "udpin:10.0.0.7:14562"]


def test_models_clocks_and_the_origin_come_over(config):
    leader, follower = config.vehicles
    assert (leader.model.tau_v_s, follower.model.tau_v_s) == (4.0, 5.0)
    assert (leader.clock.offset_s, leader.clock.drift_ppm) == (2.5, 15000)
    assert follower.clock == VehicleClock()
    assert math.degrees(config.origin.lat_rad) == pytest.approx(47.5)
    assert math.degrees(config.origin.lon_rad) == pytest.approx(8.5)
    assert (config.origin.alt_m, config.cruise_mps, config.wind_mps) == (400.0, 21.0, (1.0, 2.0, 0.0))


def test_a_vehicles_sensors_are_its_true_ones_where_those_differ_from_what_the_station_believes():
    true = {"source": "noisy", "position_sigma_m": 1.0, "outlier_share": 0.05}
    differing = {"navigation": {"source": "noisy"}, "true_navigation": true}
    path = {"waypoints_m": [[0, 0, 100], [5000, 0, 100]]}
    planned = load_scenario({"vehicles": {"count": 2} | differing, "path": path})
    (sensors, _) = (each.navigation for each in fleet_config(planned).vehicles)
    assert isinstance(sensors, NoisyNavigation)
    assert (sensors.position_sigma_m, sensors.velocity_sigma_mps, sensors.outlier_share) == (1.0, 0.1, 0.05)
    accepted = planned.vehicles[0].navigation
    assert isinstance(accepted, NoisyNavigation)
    assert accepted.position_sigma_m == 0.3


def test_a_vehicle_flies_by_its_true_model_where_that_differs_from_what_the_station_believes(tmp_path):
    path = tmp_path / "pair.yaml"
    path.write_text(SCENARIO.replace("model: {tau_v_s: 5.0}", "model: {tau_v_s: 5.0}, true_model: {tau_psi_s: 2.0}"))
    scenario = load_scenario(path)
    true = fleet_config(scenario).vehicles[1].model
    accepted = scenario.vehicles[1].model
    assert (true.tau_v_s, true.tau_psi_s) == (5.0, 2.0)
    assert (accepted.tau_v_s, accepted.tau_psi_s) == (5.0, 1.5)


def test_all_means_every_vehicle(config):
    assert config.disturbances[0][1] == {VehicleId(1, 1), VehicleId(1, 2)}
    assert config.faults[0][1] == {VehicleId(1, 2)}


def test_vehicles_fly_in_their_slots_from_the_start(config):
    first, second = (body.state for body in Fleet(config).bodies)
    assert [first.height_m, second.height_m] == pytest.approx([100.0, 100.0])
    assert second.north_m - first.north_m == pytest.approx(-30.0)
    assert second.east_m - first.east_m == pytest.approx(30.0)
    assert all(vehicle.start.in_air for vehicle in config.vehicles)
