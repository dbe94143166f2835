"""States of different ages, projected to one stamp."""

from __future__ import annotations

import numpy as np
import numpy.typing as npt
from hypothesis import given
from hypothesis import strategies as st
from librt.vecs import vec
from mypy_extensions import i64

from flight_model.vehicle_arrays import AutopilotModels, FlightStates, Setpoints
from gcs_formation.estimation.projection import MeasuredStates, Pairing, Prediction, States
from gcs_formation.estimation.setpoint_history import SetpointHistory
from tests.gcs_formation import tables

Array = npt.NDArray[np.float64]
Stamps = npt.NDArray[np.int64]

COUNT = 3
RATE_HZ = 10.0
MS = 1_000_000


def at(stamps: Stamps) -> FlightStates:
    """Return vehicles in straight flight and in steady turns, through north."""
    time_s = stamps / 1e9
    still = np.zeros(COUNT)
    speed = np.array([20.0, 22.0, 24.0])
    turned = np.remainder(3.0 + np.array([0.05, -0.05, 0.1]) * time_s + np.pi, 2 * np.pi) - np.pi
    return FlightStates(speed * time_s, -speed * time_s, 100 + time_s, still + 1, speed, turned, still, still)


def measured(stamps: Stamps, active: npt.NDArray[np.bool_] | None = None) -> MeasuredStates:
    flying = [True] * COUNT if active is None else active.tolist()
    return MeasuredStates(tables.states(at(stamps)), vec[i64](stamps.tolist()), flying, vec[i64](stamps.tolist()))


def table(states: States) -> FlightStates:
    """Return each vehicle's state when its own setpoint acts."""
    return FlightStates.from_each(states.of(vehicle, vehicle) for vehicle in range(COUNT))


periods = st.lists(st.integers(20, 400), min_size=COUNT, max_size=COUNT)


@given(periods, st.lists(st.integers(0, 300), min_size=COUNT, max_size=COUNT))
def test_pairs_are_exact_for_even_motion_whatever_rates_and_ages(period_ms: list[int], age_ms: list[int]) -> None:
    pairing, period, age = Pairing(RATE_HZ), np.array(period_ms) * MS, np.array(age_ms) * MS
    for now in range(2000, 4000, 100):
        stamps = (now * MS - age) // period * period
        states = pairing.align(measured(stamps))
        if now < 3000:
            continue
        assert states.instant(0) == stamps.min()
        expected, found = at(np.full(COUNT, stamps.min())), table(states)
        np.testing.assert_allclose(found.table[:5], expected.table[:5], atol=1e-9)
        difference = found.heading_rad - expected.heading_rad
        np.testing.assert_allclose(np.sin(difference / 2), 0.0, atol=1e-9)


def test_a_vehicle_that_is_not_active_holds_none_back() -> None:
    pairing, states = Pairing(RATE_HZ), None
    for now in (1000, 1100, 1200):
        stamps = np.array([now, now, 300]) * MS
        states = pairing.align(measured(stamps, np.array([True, True, False])))
    assert isinstance(states, MeasuredStates)
    assert states.instant(2) == 1200 * MS


def test_a_vehicle_that_comes_back_is_not_mixed_with_what_stood_for_it() -> None:
    pairing = Pairing(RATE_HZ)
    stand_in = measured(np.array([1000, 1000, 1000]) * MS, np.array([True, True, False]))
    stand_in.states[2].north_m = 1e6
    pairing.align(stand_in)
    states = pairing.align(measured(np.array([1050, 1100, 1100]) * MS))
    assert abs(states.of(2, 2).north_m - 24.0 * 1.1) < 2.0


def test_a_vehicle_that_is_no_longer_active_stays_as_measured_and_the_others_are_interpolated() -> None:
    """The third flies at 24 m/s until it leaves, and the second at 22 m/s; the pair is that of 1.05 s."""
    pairing = Pairing(RATE_HZ)
    pairing.align(measured(np.array([1000, 1000, 1000]) * MS))
    states = pairing.align(measured(np.array([1050, 1100, 1100]) * MS, np.array([True, True, False])))
    assert states.instant(2) == 1050 * MS
    norths_m = [states.of(vehicle, vehicle).north_m for vehicle in range(COUNT)]
    np.testing.assert_allclose(norths_m, [20.0 * 1.05, 22.0 * 1.05, 24.0 * 1.1])


def test_who_is_not_heard_is_taken_to_have_met_the_others_gust_when_the_other_met_it() -> None:
    """Both fly north at 20 m/s; a gust of 0.6 m/s comes at 1 s, and the second is no longer received after 0.8 s."""
    model = AutopilotModels.of(np.repeat([[4.0], [1.5], [1.0], [3.0], [16.0], [28.0], [1.5], [0.25], [3.0]], 2, axis=1))
    history, one = SetpointHistory(RATE_HZ), np.ones(2)
    tables.send(history, np.zeros(2, np.int64), Setpoints(20 * one, 0 * one, 100 * one))
    prediction, states = Prediction(history, tables.models(model), RATE_HZ), None
    for now_ms in range(0, 2100, 100):
        stamps = np.array([now_ms, min(now_ms, 800)]) * MS
        seen_s = stamps / 1e9
        gust_m, gust_mps = np.maximum(0.6 * (seen_s - 1.0), 0.0), np.where(seen_s > 1.0, 0.6, 0.0)
        level = 20 * seen_s + gust_m, -gust_m / 2, 100 * one
        state = FlightStates(*level, 0 * one, 20 * one, 0 * one, gust_mps, -gust_mps / 2)
        acts = vec[i64]([now_ms * MS] * 2)
        states = prediction.predict(MeasuredStates(tables.states(state), vec[i64](stamps.tolist()), [True] * 2, acts))
    assert states is not None
    found = states.of(1, 0)
    np.testing.assert_allclose(found.north_m, 40.6, atol=0.6 * 0.051)
    np.testing.assert_allclose((found.wind_north_mps, found.wind_east_mps), (0.6, -0.3))
    np.testing.assert_allclose(found.east_m, -0.3, atol=0.3 * 0.051)


def test_who_is_heard_is_predicted_from_its_newest_state_whatever_it_did_before() -> None:
    """It climbs, turns and speeds up against its setpoints."""
    model = AutopilotModels.of(np.repeat([[4.0], [1.5], [1.0], [3.0], [16.0], [28.0], [1.5], [0.25], [3.0]], 3, axis=1))
    history, one = SetpointHistory(RATE_HZ), np.ones(COUNT)
    tables.send(history, np.zeros(COUNT, np.int64), Setpoints(20 * one, 0 * one, 100 * one))
    prediction = Prediction(history, tables.models(model), RATE_HZ)
    for now_ms in range(1000, 3000, 100):
        stamps = np.full(COUNT, now_ms * MS)
        states = prediction.predict(measured(stamps))
        np.testing.assert_allclose(table(states).table, at(stamps).table, atol=1e-9)
