"""A multirotor ends its manoeuvre only where its way back to its slot is clear, too."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from flight_model.vehicle_arrays import AutopilotModels, Setpoints
from gcs_formation.features.separation.conflict_resolution import resolve
from tests.gcs_formation.features.separation.encounters import MODEL, Vehicles, picture

HOVERING = MODEL | {"tau_v_s": 1.0, "speed_min_mps": 0.0, "speed_max_mps": 10.0}


@pytest.mark.parametrize(
    ("other_north_m", "other_mps", "side", "manoeuvres"),
    [
        pytest.param(15.0, 3.0, 1.0, True, id="another follows it: it would turn round in front of it"),
        pytest.param(60.0, 0.0, 1.0, False, id="the other hovers far away"),
        pytest.param(15.0, 3.0, 0.0, False, id="it hasn't manoeuvred"),
    ],
)
def test_a_multirotor_that_flies_away_goes_on_with_it_while_the_way_back_is_taken(
    other_north_m: float, other_mps: float, side: float, manoeuvres: bool
) -> None:
    """It flies south at 3 m/s, and its slot is in the north: straight on it is clear of the other in each case."""
    rows: list[list[float]] = [[0, 0, 100, 3, np.pi, 0], [other_north_m, 0, 100, other_mps, np.pi, 0]]
    vehicles = Vehicles(rows, commanded=[True, False])
    back = Setpoints(np.array((6.0, 0.0)), np.zeros(2), np.full(2, 100.0))
    made = picture(vehicles, vehicles.state, back)
    models = AutopilotModels(*(np.full(2, value) for value in HOVERING.values()))
    made = replace(made, traffic=replace(made.traffic, model=models, hovers=True))
    assert bool(resolve(made, np.array((side, 0.0))).side[0]) is manoeuvres
