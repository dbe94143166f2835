# Compiled by mypyc: it runs every tick.

"""Accelerations of multirotors when their setpoints act: as measured, changed since by the setpoints in flight."""

from __future__ import annotations

import math
from typing import Final

from airlink.clock import NANOSECONDS
from flight_model.autopilot_model import AutopilotModel
from gcs_formation.estimation.projection import MeasuredStates
from gcs_formation.estimation.setpoint_history import SetpointHistory
from gcs_formation.features.separation.approach import JERK_MPS3
from gcs_formation.features.separation.non_conforming import UncommandedMotion

STEP_NS: Final = NANOSECONDS // 10
"""Steps in which accelerations are predicted through the setpoints in flight."""


class Accelerations:
    """Predicts those of commanded multirotors."""

    def __init__(
        self,
        history: SetpointHistory,
        models: list[AutopilotModel],
        uncommanded: UncommandedMotion,
        *,
        hovers: bool,
    ) -> None:
        """Take the setpoints sent, the vehicles' models, and what has measured accelerations."""
        self._history, self._models, self._uncommanded, self._hovers = history, models, uncommanded, hovers

    def of(self, index: int, measured: MeasuredStates) -> tuple[float, float]:
        """Return a multirotor's acceleration when its setpoint acts: as measured, changed since by those in flight.

        It is 0 for uncommanded vehicles, whose accelerations are intents of their own.
        """
        if not self._hovers or not measured.active[index]:
            return 0.0, 0.0
        at, acts, model = measured.stamps[index], measured.acts[index], self._models[index]
        (north_mps, east_mps), accel_mps2 = measured.states[index].ground_mps(), self._uncommanded.accel_mps2[index]
        while at < acts:
            step_ns = min(acts - at, STEP_NS)
            step_s = float(step_ns) / NANOSECONDS
            speed_mps, heading_rad, _ = self._history.commanded(at, index)
            wanted = wanted_mps2(model, (north_mps, east_mps), speed_mps, heading_rad)
            accel_mps2 = changed_mps2(accel_mps2, wanted, step_s)
            north_mps, east_mps = north_mps + step_s * accel_mps2[0], east_mps + step_s * accel_mps2[1]
            at += step_ns
        return accel_mps2


def wanted_mps2(
    model: AutopilotModel, ground_mps: tuple[float, float], speed_mps: float, heading_rad: float
) -> tuple[float, float]:
    """Return the acceleration of a multirotor's model towards a commanded velocity; 0 where none is commanded."""
    if math.isnan(speed_mps) or math.isnan(heading_rad):
        return 0.0, 0.0
    north_mps, east_mps = (
        speed_mps * math.cos(heading_rad) - ground_mps[0],
        speed_mps * math.sin(heading_rad) - ground_mps[1],
    )
    share = min(1.0 / model.tau_v_s, model.accel_max_mps2 / max(math.hypot(north_mps, east_mps), 1e-9))
    return share * north_mps, share * east_mps


def changed_mps2(begin: tuple[float, float], end: tuple[float, float], over_s: float) -> tuple[float, float]:
    """Return an acceleration that changes from one to another, after a time."""
    north_mps2, east_mps2 = begin[0] - end[0], begin[1] - end[1]
    left = max(1.0 - JERK_MPS3 * over_s / max(math.hypot(north_mps2, east_mps2), 1e-9), 0.0)
    return end[0] + left * north_mps2, end[1] + left * east_mps2
