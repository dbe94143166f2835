"""Predicted ways of multirotors hold what their emulation does: an acceleration takes time to change."""

from __future__ import annotations

import math
from typing import Any

import numpy as np
import pytest

from flight_model.vehicle_arrays import AutopilotModels, FlightStates, Setpoints
from formation_scenario import load_scenario
from gcs_formation.features.separation.approach import Manoeuvre, Traffic, fly_level, sample_times
from gcs_formation.from_scenario import autopilot_models
from sim_vehicles.airframe.hovering import HoveringBody
from sim_vehicles.board_clock import LOOP_S
from sim_vehicles.config import fleet_config

TIMES_S = sample_times(0.3, 12.0)


class Copter:
    """An emulated ArduCopter without wind, and its prediction."""

    def __init__(self, **vehicles: Any) -> None:
        planned = load_scenario(
            {
                "vehicles": {"count": 1, "autopilot": "arducopter"},
                "start": {"in_air": True},
                "path": {"speed_mps": 5, "waypoints_m": [[0, 0, 60], [500, 0, 60]]},
            }
        )
        self.models = autopilot_models(planned)
        self.body = HoveringBody(fleet_config(planned).vehicles[0], (0.0, 0.0, 0.0), 0)
        self.body.steering.airborne = True
        self.changed = (0.0, 0.0)
        """Acceleration in the last cycle."""

    def fly(self, seconds: float, *velocity_mps: float) -> list[tuple[float, float]]:
        """Return the places, north and east, after each cycle."""
        places = []
        self.body.steering.velocity_mps = velocity_mps[0], velocity_mps[1], 0.0
        for _ in range(round(seconds / LOOP_S)):
            before = self.body.velocity_mps
            self.body.fly()
            north, east, _ = self.body.velocity_mps
            self.changed = (north - before[0]) / LOOP_S, (east - before[1]) / LOOP_S
            places.append((self.body.state.north_m, self.body.state.east_m))
        return places

    def predicted_m(self, *velocity_mps: float) -> Any:
        """Return north and east, (2, S), as predicted from now on, commanded this velocity."""
        state, (north_mps, east_mps, _) = self.body.state, self.body.velocity_mps
        ground = math.hypot(north_mps, east_mps), math.atan2(east_mps, north_mps)
        now = FlightStates.of(np.array([(state.north_m, state.east_m, 60.0, 0.0, *ground, 0.0, 0.0, 0.0)]).T)
        commands = [np.array([each]) for each in (math.hypot(*velocity_mps), math.atan2(*reversed(velocity_mps)), 60.0)]
        models, still = AutopilotModels.from_each(self.models), np.zeros(1)
        traffic = Traffic(now, still, still, models, np.array([self.changed]).T, hovers=True)
        return fly_level(traffic, Manoeuvre(Setpoints(*commands), *commands), TIMES_S)[:, :, 0]


@pytest.mark.parametrize("accelerates_s", [0.6, 1.0, 1.5, 6.0])
@pytest.mark.parametrize("then_mps", [(0.0, 0.0), (0.0, 8.0), (-4.0, 0.0)])
def test_a_copter_commanded_otherwise_while_it_accelerates_is_where_it_is_predicted(
    accelerates_s: float, then_mps: tuple[float, float]
) -> None:
    """Predicted without a limit of jerk, 11 of the 12 are up to 2.4 to 8.4 m off within 4 s."""
    copter = Copter()
    copter.fly(3.0, 0.0, 0.0)
    copter.fly(accelerates_s, 8.0, 0.0)
    predicted_m, off_m = copter.predicted_m(*then_mps), []
    flown_m = copter.fly(4.0, *then_mps)
    for at_s, north_m, east_m in zip(TIMES_S[1:], *predicted_m[:, 1:], strict=True):
        if at_s < 4.0:
            north, east = flown_m[round(at_s / LOOP_S) - 1]
            off_m.append(math.hypot(north_m - north, east_m - east))
    assert max(off_m) < 1.5
