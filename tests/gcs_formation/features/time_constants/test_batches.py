"""Which samples make a batch, and which batches are fitted."""

from __future__ import annotations

import math
from types import SimpleNamespace
from typing import Any

import numpy as np
import pytest

from flight_model.autopilot_model import AutopilotModel
from gcs_formation.estimation.setpoint_history import SetpointHistory
from gcs_formation.features.time_constants.estimator import TimeConstantEstimator, VehicleEstimator
from gcs_formation.features.time_constants.interpolation import Nodes
from tests.gcs_formation.features.time_constants.test_estimation import CORNERS, flown
from tests.gcs_formation.features.time_constants.test_parts import HEADING_S, SPEED_S, model

SETPOINT = 22.5, 0.1, 100.0


def sent(setpoint: tuple[float, float, float] = SETPOINT) -> Any:
    return SimpleNamespace(acting=lambda _: 0, later=lambda index, _: index, mean=lambda *_: setpoint)


def turning(seconds: float, ratio: float) -> tuple[float, float, float, float]:
    """Return the motion a time after a step of the setpoints of airspeed and heading."""
    speed_mps = 22.5 - 0.5 * math.exp(-seconds / (ratio * SPEED_S))
    return speed_mps, 0.1 - 0.1 * math.exp(-seconds / (ratio * HEADING_S)), 100.0, 0.0


def fitted(times_s: list[float], *, estimating: bool = True) -> VehicleEstimator:
    """Return what was estimated of a vehicle with time constants 1.4 times as long, by samples at these times."""
    vehicle = VehicleEstimator(model(), Nodes(5, 1), Nodes(4, 2), 50, 10.0, estimated=True, in_use=True)
    vehicle.add_sample(0, turning(0.0, 1.4))
    vehicle.update(sent())
    for time_s in times_s:
        vehicle.add_sample(round(time_s * 1e9), turning(time_s, 1.4))
        vehicle.add_newest(estimating=estimating)
    vehicle.update(sent())
    return vehicle


@pytest.mark.parametrize(("last_s", "used"), [(3.9, True), (4.1, False)])
def test_a_batch_with_a_gap_is_fitted_if_it_lasts_three_seconds_more_than_usual_at_most(
    last_s: float, used: bool
) -> None:
    vehicle = fitted([0.2, 0.4, last_s - 0.4, last_s - 0.2, last_s])
    found = vehicle.log_ratios()
    assert (found[0] > 0.0, found[1] > 0.0) == (used, used)
    assert (vehicle.model.tau_v_s > SPEED_S, vehicle.model.tau_psi_s > HEADING_S) == (used, used)


class Recorded:
    """An estimator that records what it found after each tick; its law's rate is another one."""

    def __init__(
        self, models: list[AutopilotModel], history: SetpointHistory, telemetry_hz: float, _: float, *, in_use: bool
    ) -> None:
        self.of = TimeConstantEstimator(models, history, telemetry_hz, 1.0, in_use=in_use)
        self.add_sample, self.found = self.of.add_sample, list[list[float]]()

    def update(self, estimating: list[bool]) -> None:
        self.of.update(estimating)
        self.found.append(self.of.vehicles[0].log_ratios())


def test_two_ticks_are_a_batch_of_a_law_that_is_slower_than_that() -> None:
    found = np.array(flown(CORNERS[:1], 20, kind=Recorded).found)
    changed = np.flatnonzero(np.any(np.diff(found, axis=0), axis=1))
    assert changed.size > 20
    assert set((np.diff(changed) % 2).tolist()) == {0}
    assert min(np.diff(changed)) == 2
