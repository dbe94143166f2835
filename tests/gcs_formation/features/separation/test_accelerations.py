"""An acceleration changes by 5 m/s³ at most: velocities and positions that follow, by hand."""

from __future__ import annotations

import numpy as np
import pytest

from flight_model.arrays import Array
from flight_model.vehicle_arrays import AutopilotModels, FlightStates, Setpoints
from formation_scenario import load_scenario
from gcs_formation.features.separation.accelerations import changed_mps2, wanted_mps2
from gcs_formation.features.separation.approach import Manoeuvre, Traffic, fly_level
from gcs_formation.from_scenario import autopilot_models
from tests.flights.conftest import scenario
from tests.gcs_formation.features.separation.encounters import MODEL


@pytest.mark.parametrize(
    ("begin", "over_s", "expected"),
    [
        ((4.0, 0.0), 0.2, (3.0, 0.0)),
        ((3.0, -4.0), 0.5, (1.5, -2.0)),
        ((0.0, 2.0), 0.4, (0.0, 0.0)),
        ((0.0, 2.0), 5.0, (0.0, 0.0)),
    ],
)
def test_an_acceleration_goes_straight_to_the_wanted_one_by_the_jerk_and_stays_there(
    begin: tuple[float, float], over_s: float, expected: tuple[float, float]
) -> None:
    assert changed_mps2(begin, (0.0, 0.0), over_s) == pytest.approx(expected, abs=1e-12)
    moved = changed_mps2((begin[0] + 1.0, begin[1] + 2.0), (1.0, 2.0), over_s)
    assert moved == pytest.approx((expected[0] + 1.0, expected[1] + 2.0), abs=1e-12)


def test_a_multirotor_wants_its_velocity_error_by_its_time_constant_within_its_limit() -> None:
    planned = load_scenario(scenario(vehicles={"count": 2, "model": "arducopter"}, path=SLOW))
    model = autopilot_models(planned)[0]
    assert wanted_mps2(model, (1.0, 0.0), 1.5, 0.0) == pytest.approx((0.5 / model.tau_v_s, 0.0))
    assert wanted_mps2(model, (0.0, 99.0), 0.0, 0.0) == pytest.approx((0.0, -model.accel_max_mps2))
    assert wanted_mps2(model, (1.0, 0.0), float("nan"), 0.0) == (0.0, 0.0)


SLOW = {"speed_mps": 5, "waypoints_m": [[0, 0, 60], [500, 0, 60]]}


def north_m(times_s: list[float], lead_s: float = 0.0) -> Array:
    """Return where a multirotor gets that flies as commanded, 8 m/s north, but still accelerates by 2.5 m/s² north.

    Its time constant is long, so that nothing but the rest of that acceleration changes its velocity.
    """
    models = AutopilotModels(
        *(np.array([value]) for value in (MODEL | {"tau_v_s": 1e9, "speed_min_mps": 0.0}).values())
    )
    state = FlightStates.of(np.array([[0.0], [0.0], [60.0], [0.0], [8.0], [0.0], [0.0], [0.0], [0.0]]))
    commands = [np.array([each]) for each in (8.0, 0.0, 60.0)]
    traffic = Traffic(state, np.array([lead_s]), np.zeros(1), models, np.array([[2.5], [0.0]]), hovers=True)
    return fly_level(traffic, Manoeuvre(Setpoints(*commands), *commands), np.array(times_s))[0, :, 0]


def test_the_rest_of_an_acceleration_carries_a_multirotor_on() -> None:
    """It ends after 0.5 s, has then added 0.625 m/s, and 2.5 t²/2 - 5 t³/6 m on the way."""
    assert north_m([0.0, 0.5, 1.0, 2.0]) == pytest.approx([0.0, 4.0 + 0.3125 - 0.625 / 6, 8.5208, 17.1458], abs=1e-4)
    assert north_m([0.0, 0.25, 0.5]) == pytest.approx([0.0, 2.0651, 4.2083], abs=0.01)
    assert north_m([0.0, 0.25], lead_s=0.25) == pytest.approx([2.0651, 4.2083], abs=1e-4)
