"""Telemetry of noisy vehicles, as pymavlink reads it, beside their true state."""

import math

import numpy as np
import pytest

from airlink.clock import Instant
from airlink.endpoint import VehicleId
from formation_scenario.navigation import NoisyNavigation
from sim_vehicles.airframe.motion import Motion
from sim_vehicles.autopilot.sensors import Sensors

GNSS = NoisyNavigation(source="noisy")
UNITS = ("_m", "_mps", "_rad", "_radps")
STILL = Motion(0.0, 0.0, 0.0, 0.0, 22.0, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0)
REPORTED = (
    "north_m",
    "east_m",
    "height_m",
    "velocity_north_mps",
    "velocity_east_mps",
    "velocity_down_mps",
    "airspeed_mps",
    "heading_rad",
)
SIGMAS = (0.3, 0.3, 0.3, 0.1, 0.1, 0.1, 0.2, math.radians(0.5))


def errors(samples, vehicle=1, seed=1, keys=GNSS):
    """Return (samples, 8): telemetry minus truth, a sample every 0.1 s."""
    sensors = Sensors(keys, VehicleId(1, vehicle), seed)
    reported = [sensors.sense(STILL, Instant(n * 100_000_000)) for n in range(samples)]
    return np.array([[getattr(each, name) - getattr(STILL, name) for name in REPORTED] for each in reported])


def test_errors_are_white_independent_and_of_the_stated_sigmas():
    found = errors(8000)
    assert found.std(axis=0) == pytest.approx(SIGMAS, rel=0.04)
    assert np.abs(found.mean(axis=0) / SIGMAS).max() < 0.05
    both = np.hstack((found[1:], found[:-1], errors(7999, vehicle=2)))
    assert np.abs(np.corrcoef(both.T) - np.eye(24)).max() < 0.05


def test_gauss_markov_errors_keep_their_sigma_and_fade_exponentially():
    found = errors(40_000, keys=NoisyNavigation(source="noisy", correlation_s=2.0)) / SIGMAS
    assert found.std(axis=0) == pytest.approx(1.0, rel=0.06)
    assert (found[20:] * found[:-20]).mean() == pytest.approx(math.exp(-1.0), abs=0.05)


def test_a_sample_s_errors_stay_until_the_next_sample_and_depend_on_nothing_else():
    sensors = Sensors(GNSS, VehicleId(1, 1), 1)
    seen = [sensors.sense(STILL, Instant(at)) for at in (350_000_000, 399_000_000)]
    assert all(getattr(seen[0], each) == getattr(seen[1], each) for each in dir(STILL) if each.endswith(UNITS))
    assert sensors.sense(STILL, Instant(400_000_000)).north_m == errors(5)[4][0]


def test_telemetry_is_noisy_and_the_vehicle_flies_as_if_it_were_not(make_air):
    noisy, clean = make_air(1, navigation=GNSS), make_air(1)
    for air in (noisy, clean):
        air.set_mode(15)
        air.command_long(511, 33, 100_000)
        air.command_int(43002, 1, 40.0, 10.0)
        air.run(60.0)
    assert noisy.fleet.bodies[0].state.values() == clean.fleet.bodies[0].state.values()
    heights = [message.relative_alt / 1e3 for message in noisy.ground.of("GLOBAL_POSITION_INT")]
    assert np.std(heights) == pytest.approx(0.3, rel=0.15)
    assert {message.relative_alt for message in clean.ground.of("GLOBAL_POSITION_INT")} == {100_000}


def test_outliers_are_of_the_stated_share_and_distance_and_leave_the_other_errors_alone():
    strays = NoisyNavigation(source="noisy", outlier_share=0.05, outlier_m=20.0)
    difference = errors(4000, keys=strays) - errors(4000)
    far_m = np.hypot(difference[:, 0], difference[:, 1])
    assert np.mean(far_m > 1.0) == pytest.approx(0.05, abs=0.01)
    assert far_m[far_m > 1.0] == pytest.approx(20.0)
    assert not difference[:, 2:].any()
