"""Dryden's turbulence against MIL-F-8785C: figures computed by hand, variance and spectra of the gusts."""

import math
from types import SimpleNamespace
from typing import Any

import numpy as np
import numpy.typing as npt
import pytest
from scipy.linalg import expm
from scipy.signal import welch

from flight_model.flight_state import FlightState
from formation_scenario.surroundings import DrydenTurbulence
from sim_vehicles.airframe.in_air import InAir
from sim_vehicles.airframe.turbulence import DrydenGusts, discretised

AIRSPEED_MPS, DT_S, VEHICLES = 22.0, 0.1, 64
SIGMA_MPS, LENGTH_M = (1.5, 1.0, 0.5), (60.0, 40.0, 20.0)
GIVEN = DrydenTurbulence(kind="dryden", at_s=0.0, sigma_mps=SIGMA_MPS, length_m=LENGTH_M)


def flown(steps, airspeed_mps: npt.ArrayLike = AIRSPEED_MPS, count=VEHICLES):
    """Return gusts (steps, 3, count)."""
    streams = [np.random.Generator(np.random.Philox(each)) for each in np.random.SeedSequence(1).spawn(count)]
    gusts = DrydenGusts(GIVEN, [], streams)
    speed, height = np.broadcast_to(airspeed_mps, (steps,)), np.full(count, 100.0)
    return np.stack([gusts.advance(np.full(count, each), height, DT_S) for each in speed])


def test_intensities_and_scale_lengths_of_low_altitude():
    """At 500 ft: 0.177 + 0.000823 * 500 = 0.5885; 500 / 0.5885^1.2 = 944.7 ft; 0.5885^-0.4 = 1.2362."""
    sigma_mps, length_m = DrydenTurbulence(kind="dryden", at_s=0.0, wind_6m_mps=10.0).scales(np.array([500 * 0.3048]))
    assert sigma_mps[:, 0] == pytest.approx([1.2362, 1.2362, 1.0], rel=1e-4)
    assert length_m[:, 0] / 0.3048 == pytest.approx([944.7, 944.7, 500.0], rel=1e-4)


def test_at_1000_ft_and_beyond_turbulence_is_isotropic():
    """0.177 + 0.000823 * 1000 = 1."""
    sigma_mps, length_m = DrydenTurbulence(kind="dryden", at_s=0.0, wind_6m_mps=8.0).scales(np.array([304.8, 2000.0]))
    assert sigma_mps == pytest.approx(0.8)
    assert length_m == pytest.approx(304.8)


@pytest.mark.parametrize("duration", [1e-3, 0.05, 0.7, 5.0])
def test_the_lateral_filter_is_discretised_exactly(duration):
    """Against Van Loan's matrix exponential (IEEE Transactions on Automatic Control 23, 1978)."""
    dynamics, noise = np.array([[-1.0, 0.0], [1.0, -1.0]]), np.diag([1.0, 0.0])
    block = expm(np.block([[-dynamics, noise], [np.zeros((2, 2)), dynamics.T]]) * duration)
    transition, factor = discretised(np.array(duration))
    assert transition == pytest.approx(block[2:, 2:].T, rel=1e-12)
    assert factor @ factor.T == pytest.approx(transition @ block[:2, 2:], rel=1e-6, abs=1e-15)


def test_the_rms_values_are_those_asked_for_whatever_the_airspeed_does():
    airspeed_mps = np.where(np.arange(4000) % 600 < 300, 15.0, 30.0)
    gusts = flown(4000, airspeed_mps=airspeed_mps)
    assert np.sqrt((gusts**2).mean(axis=(0, 2))) == pytest.approx(SIGMA_MPS, rel=0.02)
    assert np.sqrt((gusts[:20] ** 2).mean(axis=(0, 2))) == pytest.approx(SIGMA_MPS, rel=0.25)


def dryden(axis, wave_radpm):
    """Return Phi of MIL-F-8785C, section 3.7.1.2, whose integral over 0 to infinity rad/m is sigma^2."""
    sigma, length = SIGMA_MPS[axis], LENGTH_M[axis]
    x2 = (length * wave_radpm) ** 2
    if axis == 0:
        return sigma**2 * 2 * length / math.pi / (1 + x2)
    return sigma**2 * length / math.pi * (1 + 3 * x2) / (1 + x2) ** 2


@pytest.fixture(scope="module")
def gusts():
    return flown(8192)


@pytest.mark.parametrize("axis", [0, 1, 2])
def test_the_spectra_are_drydens(gusts, axis):
    frequency_hz, density = welch(gusts[:, axis], fs=1 / DT_S, nperseg=1024, axis=0)
    seen = (frequency_hz > 0.02) & (frequency_hz < 1.0)
    per_hz = dryden(axis, 2 * math.pi * frequency_hz[seen] / AIRSPEED_MPS) * 2 * math.pi / AIRSPEED_MPS
    bands = [chunk.mean() for chunk in np.array_split(density.mean(axis=1)[seen] / per_hz, 8)]
    assert bands == pytest.approx([1.0] * 8, rel=0.08)


def test_vehicles_and_axes_are_independent_of_each_other():
    gusts = flown(3000, count=4).reshape(3000, 12)
    correlation = np.corrcoef(gusts[::20].T)
    assert np.abs(correlation - np.eye(12)).max() < 0.4


class Still(InAir):
    """A vehicle that stays where it is."""

    @property
    def airborne(self) -> bool:
        return True

    def ground_velocity(self) -> tuple[float, float, float]:
        return 0.0, 0.0, 0.0


@pytest.mark.parametrize(("hovers", "turns"), [(False, True), (True, False)])
def test_a_wings_gusts_turn_with_it_and_a_multirotors_lie_along_the_wind(hovers, turns):
    """A multirotor at low speed may take any course from one cycle to the next; its gusts used to rotate with that."""
    model: Any = SimpleNamespace(may_hover=hovers)
    body = Still(model, FlightState(0.0, 0.0, 100.0, 0.0, 0.1, 0.0, 0.0, 0.0), (0.0, 0.0, 0.0))
    gusts = DrydenGusts(GIVEN, [body], [np.random.default_rng(1)], (5.0, 0.0, 0.0))
    gusts.add(0.0)
    north_mps, east_mps, _ = body.disturbance_mps
    body.disturbance_mps, body.state.heading_rad = (0.0, 0.0, 0.0), math.pi / 2
    gusts.add(0.02)
    turned = math.hypot(body.disturbance_mps[0] - north_mps, body.disturbance_mps[1] - east_mps)
    assert (turned > 0.5 * math.hypot(north_mps, east_mps)) is turns
