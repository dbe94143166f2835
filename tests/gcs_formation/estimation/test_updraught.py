"""Updraughts from corrections of the climb, by hand."""

from __future__ import annotations

import math

import pytest

from flight_model.autopilot_model import AutopilotModel
from flight_model.flight_state import FlightState
from gcs_formation.estimation.noise_and_plausibility import VehicleNoise
from gcs_formation.estimation.updraught import Updraught
from gcs_formation.estimation.vehicle_filter import VehicleFilter

MODEL = AutopilotModel(4.0, 1.5, 1.0, 3.0, 16.0, 28.0, 9.0, 9.0, 9.0)
"""The time constants of its height add up to 4 s; their rates to 4/3 per second."""
STEP_S, EXACT = 0.3, 1e-12


def flying() -> FlightState:
    return FlightState(0.0, 0.0, 100.0, 0.0, 22.0, 0.0, 0.0, 0.0)


def test_what_exceeds_two_standard_deviations_counts_by_the_share_of_its_square_beyond() -> None:
    """1 m/s with 0.2 m/s of noise: 1 - 0.16 of it, which sways the height by 4 s times that."""
    updraught, state = Updraught(followed=True), flying()
    updraught.update(state, 1.0, 0.04, STEP_S, MODEL)
    assert updraught.sway_m2 == pytest.approx((4.0 * 0.84) ** 2)
    assert state.updraught_mps == pytest.approx(0.84 * (1.0 - math.exp(-2.0 * STEP_S / 4.0)))


@pytest.mark.parametrize("climbs_mps", [0.39, -0.39])
def test_noise_carries_nothing(climbs_mps: float) -> None:
    updraught, state = Updraught(followed=True), flying()
    updraught.update(state, climbs_mps, 0.04, STEP_S, MODEL)
    assert updraught.sway_m2 == state.updraught_mps == 0.0


@pytest.mark.parametrize("climbs_mps", [0.5, -0.5])
def test_what_passes_decays_with_both_time_constants_and_what_lasts_is_followed(climbs_mps: float) -> None:
    """e^-0.4 of a single push is left after 0.3 s. The updraught of the state makes up for the rest."""
    updraught, state = Updraught(followed=False), flying()
    for _ in range(2):
        updraught.update(state, climbs_mps, EXACT, STEP_S, MODEL)
        climbs_mps = 0.0
    assert updraught.sway_m2 == pytest.approx((2.0**2 + (2.0 * math.exp(-0.4)) ** 2) / 2.0)
    updraught, state = Updraught(followed=True), flying()
    for _ in range(200):
        updraught.update(state, (1.0 - math.exp(-0.4)) * (-0.7 - state.updraught_mps), EXACT, STEP_S, MODEL)
    assert state.updraught_mps == pytest.approx(-0.7)


@pytest.mark.parametrize(("first_s", "second_s"), [(0.5, 2.0), (2.0, 0.5)])
def test_either_time_constant_makes_what_passes_decay_as_fast(first_s: float, second_s: float) -> None:
    """Of 0.5 s and 2 s, whichever is whose: e^-0.75 is left after 0.3 s, of 2.5 s times the push."""
    model = AutopilotModel(4.0, 1.5, first_s, second_s, 16.0, 28.0, 9.0, 9.0, 9.0)
    updraught, state = Updraught(followed=False), flying()
    for climbs_mps in (0.4, 0.0):
        updraught.update(state, climbs_mps, EXACT, STEP_S, model)
    assert updraught.sway_m2 == pytest.approx((1.0 + math.exp(-0.75) ** 2) / 2.0)


def test_the_first_minute_is_a_plain_mean() -> None:
    """Half of it with a push that lasts, of 0.5 m/s at 4 s: 4 m² and then none."""
    updraught = Updraught(followed=False)
    for number in range(200):
        updraught.clear()
        updraught.update(flying(), 0.5 if number < 100 else 0.0, EXACT, STEP_S, MODEL)
    assert updraught.sway_m2 == pytest.approx(2.0)
    for _ in range(200):
        updraught.update(flying(), 0.0, EXACT, STEP_S, MODEL)
    assert updraught.sway_m2 == pytest.approx(2.0 * (1.0 - STEP_S / 60.0) ** 200)


def test_a_repeated_stamp_is_no_time() -> None:
    updraught, state = Updraught(followed=True), flying()
    updraught.update(state, 1.0, EXACT, 0.0, MODEL)
    assert updraught.sway_m2 == state.updraught_mps == 0.0


@pytest.mark.parametrize(("climb_mps", "airspeed_mps", "rises"), [(0.01, 5.0, True), (1.0, 0.01, False)])
def test_a_filter_finds_updraughts_beyond_the_noise_of_climbs(
    climb_mps: float, airspeed_mps: float, rises: bool
) -> None:
    """However noisy airspeeds are: it climbs at 1 m/s, unlike what the model says."""
    noise = 0.1, 0.1, 0.1, climb_mps, airspeed_mps, 0.01
    one = VehicleFilter(VehicleNoise(noise, noise), 0.1, 10.0, updraughts=True)
    one.initialise((0.0, 0.0, 100.0, 22.0, 0.0, 0.0, 22.0, 0.0), 0)
    one.correct((2.2, 0.0, 100.0, 22.0, 0.0, 1.0, 22.0, 0.0), 100_000_000, flying(), MODEL, commanded=True)
    assert one.state is not None
    assert (one.state.updraught_mps > 0.0) == rises
