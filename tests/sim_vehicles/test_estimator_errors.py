"""Vehicles that fly by their own estimate: they report what they are commanded, and truly wander."""

from __future__ import annotations

import math
from typing import Any, get_args

import numpy as np
import pytest

from airlink.clock import Instant
from airlink.endpoint import VehicleId
from formation_scenario.navigation import EstimatorNavigation
from formation_scenario.vehicles import Family, VehicleModel
from sim_vehicles.autopilot.estimator_errors import ESTIMATES, EstimatorErrors, StateEstimator, errors_of
from tests.sim_vehicles.test_sensors import REPORTED, STILL

ERRORS = EstimatorErrors(0.2, 1.0, 0.1, 2.0, 0.3, 0.4, 2.0, 0.5, 5.0, 0.6)
OF_EACH = (0.3, 0.3, 0.4, 0.2, 0.2, 0.1, 0.6, math.radians(0.5))
"""As `REPORTED`."""
COPTER = VehicleModel(hovers=True, speed_min_mps=0.0, speed_max_mps=9.0)


def test_errors_have_the_stated_sigmas_and_correlations_and_a_heading_its_offset() -> None:
    estimator = StateEstimator(ERRORS, VehicleId(1, 1), 1)
    reported = [estimator.sense(STILL, Instant(n * 100_000_000)) for n in range(30_000)]
    found = np.array([[getattr(each, name) - getattr(STILL, name) for name in REPORTED] for each in reported])
    assert found[:, :-1].std(axis=0) == pytest.approx(OF_EACH[:-1], rel=0.1)
    assert math.degrees(found[:, -1].mean()) == pytest.approx(2.0, abs=0.2)
    for column, after in ((3, 10), (5, 20), (0, 10), (2, 20)):
        each = found[:, column] / OF_EACH[column]
        assert (each[after:] * each[:-after]).mean() == pytest.approx(math.exp(-1.0), abs=0.12)


def test_a_family_has_its_simulators_errors_but_for_keys_that_are_given() -> None:
    keys = EstimatorNavigation(source="estimator", heading_offset_deg=3.0)
    assert errors_of(keys, "px4_copter") == ESTIMATES["px4_copter"]._replace(heading_offset_deg=3.0)
    rough = EstimatorNavigation(source="estimator", air="rough", height_sigma_m=0.15)
    found = errors_of(rough, "arduplane")
    assert (found.height_sigma_m, found.climb_sigma_mps, found.airspeed_sigma_mps) == (0.15, 0.06, 0.75)
    assert found.heading_offset_deg == ESTIMATES["arduplane"].heading_offset_deg
    assert errors_of(rough, "arducopter") == ESTIMATES["arducopter"]._replace(height_sigma_m=0.15), (
        "gusts hardly move it"
    )


def test_every_family_of_emulated_vehicles_has_its_errors() -> None:
    """A PX4 in Guided Course had none."""
    assert set(ESTIMATES) == set(get_args(Family))


@pytest.mark.parametrize("model", [VehicleModel(), COPTER])
def test_a_vehicle_that_takes_itself_to_be_faster_is_slower_and_reports_the_commanded_velocity(
    make_air: Any, model: VehicleModel
) -> None:
    """Its true velocity is off by as much as its estimate, the other way: what it reports is as if nothing were."""
    far = EstimatorNavigation(
        source="estimator", velocity_sigma_mps=0.5, velocity_correlation_s=1e6, position_sigma_m=0.0
    )
    wrong, right = make_air(1, navigation=far, model=model), make_air(1, model=model)
    for air in (wrong, right):
        air.run(10.0)
    (body,), (other,) = wrong.fleet.bodies, right.fleet.bodies
    unknown = np.array(body.unknown_mps)
    assert np.abs(unknown[:2]).min() > 0.01
    moved = np.array((body.state.north_m - other.state.north_m, body.state.east_m - other.state.east_m))
    assert moved == pytest.approx(10.0 * unknown[:2], rel=0.02)
    velocity = np.subtract(body.ground_velocity(), other.ground_velocity())
    assert velocity[:2] == pytest.approx(unknown[:2], abs=1e-3)
    reported = wrong.fleet.vehicles[0].estimate.received
    assert reported.velocity_north_mps == pytest.approx(other.ground_velocity()[0], abs=1e-3)
