"""Who has given way gets back to its slot by itself, also where all climb and each lags behind in its own way."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from flight_model.arrays import Array
from flight_model.vehicle_arrays import AutopilotModels, FlightStates, Setpoints, advance
from gcs_formation.features.separation.approach import Traffic
from gcs_formation.features.separation.broad_phase import KeptDistance
from gcs_formation.features.separation.conflict_resolution import resolve
from gcs_formation.features.separation.traffic import FARTHER_MPS, FARTHEST_M, PATIENCE_S, TrafficPicture, free_heights
from tests.gcs_formation.features.separation.encounters import DT_S, TIMES_S, model

KEPT_M, SPEED_MPS = 10.5, 22.0
QUICK_S, SLOW_S = (0.6, 1.5), (1.1, 4.3)
"""Lags of height, of the one that leads and of the one above it."""
BESIDE_M = np.array([15.0, 0.0])
"""Slots of the two, to the right: each is beyond the other."""


def time_constants(quick_s: tuple[float, float], slow_s: tuple[float, float]) -> AutopilotModels:
    models = model(2)
    models.table[2:4] = np.array((quick_s, slow_s)).T
    return models


def picture(
    state: FlightStates, law: Setpoints, models: AutopilotModels, manoeuvring_s: Array | None = None
) -> TrafficPicture:
    return TrafficPicture(
        traffic=Traffic(state, np.zeros(2), np.zeros(2), models, np.zeros((2, 2)), hovers=False),
        setpoints=law,
        commanded=np.ones(2, dtype=bool),
        vehicles=np.arange(2),
        kept=KeptDistance(KEPT_M),
        slots_m=100.0 * np.arange(2) * np.ones((3, 1)),
        timing_s=np.full(2, 0.04),
        floor=lambda state: np.full(state.north_m.size, 15.0),
        times_s=TIMES_S,
        manoeuvring_s=manoeuvring_s,
    )


def flown(climb_mps: float, models: AutopilotModels) -> tuple[float, float]:
    """Fly for a minute from where one avoids above the other, each on the wrong side; return until when, how near.

    The law leads heights by the lags that it knows, and slots by nothing.
    """
    true, side, manoeuvring_s = time_constants(QUICK_S, SLOW_S), np.array([-1.0, 1.0]), np.zeros(2)
    still = np.zeros(2)
    state = FlightStates(
        still, np.array([3.0, 8.0]), np.array([100.0, 110.6]), still + climb_mps, still + SPEED_MPS, still, still, still
    )
    until_s, min_m = 0.0, np.inf
    tau_s = models.tau_ha_s + models.tau_hb_s
    for step in range(600):
        height_m = 100.0 + climb_mps * (step * DT_S + tau_s)
        max_m = models.climb_max_mps * tau_s
        law = Setpoints(
            still + SPEED_MPS,
            np.clip(0.02 * (BESIDE_M - state.east_m), -0.5, 0.5),
            np.clip(height_m, state.height_m - max_m, state.height_m + max_m),
        )
        decided = resolve(picture(state, law, models, manoeuvring_s), side)
        side = decided.side
        manoeuvring_s = np.where(side != 0.0, manoeuvring_s + DT_S, 0.0)
        until_s = step * DT_S if side.any() else until_s
        state = advance(state, decided.setpoints.table, np.full(2, DT_S), true)
        min_m = min(min_m, float(np.linalg.norm(np.diff(state.position_m))))
    assert np.abs(state.east_m - BESIDE_M).max() < 0.5
    return until_s, min_m


@pytest.mark.parametrize("climb_mps", [0.0, 0.35, 2.0])
def test_those_that_climb_with_time_constants_of_their_own_get_back_and_keep_the_distance(climb_mps: float) -> None:
    until_s, min_m = flown(climb_mps, time_constants(QUICK_S, SLOW_S))
    assert until_s < 6.0
    assert min_m > KEPT_M


@pytest.mark.slow
@pytest.mark.parametrize(
    ("climb_mps", "max_s"),
    [pytest.param(0.35, 20.0, marks=pytest.mark.slow), pytest.param(0.7, 25.0, marks=pytest.mark.slow), (1.2, 30.0)],
)
def test_who_gets_where_no_model_says_gets_back_all_the_same(climb_mps: float, max_s: float) -> None:
    """Lags are 2 s shorter or longer than known."""
    until_s, _ = flown(climb_mps, model(2))
    assert until_s < max_s


def test_who_has_given_way_for_long_aims_farther_by_and_by() -> None:
    law = Setpoints(np.full(2, SPEED_MPS), np.zeros(2), np.full(2, 100.0))
    state = FlightStates(*np.tile([[0.0], [0.0], [100.0], [0.0], [SPEED_MPS], [0.0], [0.0], [0.0]], 2))
    made = picture(state, law, model(2), np.array([PATIENCE_S + 4.0, 1e3]))
    assert (made.farther_m(0), made.farther_m(1)) == (4.0 * FARTHER_MPS, FARTHEST_M)
    assert picture(state, law, model(2)).farther_m(0) == 0.0


def test_where_all_lag_alike_the_climb_changes_nothing() -> None:
    law = Setpoints(np.full(2, SPEED_MPS), np.zeros(2), np.full(2, 100.0))
    state = FlightStates(*np.tile([[0.0], [0.0], [100.0], [2.0], [SPEED_MPS], [0.0], [0.0], [0.0]], 2))
    assert picture(state, law, model(2)).trails_m.tolist() == [0.0, 0.0]
    climbing = picture(state, law, time_constants(QUICK_S, SLOW_S))
    assert climbing.trails_m.tolist() == pytest.approx([0.0, 2.0 * (5.4 - 2.1)])
    assert not replace(climbing, evades=True).trails_m.any(), "a leader that avoids climbs to a height"


def test_who_lags_behind_a_climb_more_than_the_leader_passes_at_heights_that_make_up_for_it() -> None:
    """11.5 m, 1 m more than is kept, above or below 100 m, and 2 m/s for the 3.3 s that it lags behind more."""
    law = Setpoints(np.full(2, SPEED_MPS), np.zeros(2), np.full(2, 100.0))
    state = FlightStates(*np.tile([[0.0], [0.0], [100.0], [2.0], [SPEED_MPS], [0.0], [0.0], [0.0]], 2))
    climbing = picture(state, law, time_constants(QUICK_S, SLOW_S))
    heights_m = free_heights(climbing, 1, np.array([0]), np.array([100.0]), 0.0)
    assert heights_m.tolist() == pytest.approx([111.5 + 6.6, 88.5 + 6.6])
