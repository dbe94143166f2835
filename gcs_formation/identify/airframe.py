"""Fits an airframe under total-energy control, which emulators fly, to one flight from its first point to its last."""

from __future__ import annotations

import math
from collections.abc import Callable, Sequence

import numpy as np

from flight_model import energy
from flight_model.arrays import Array
from flight_model.frequency_response import slow_taus_s
from formation_scenario.vehicles import EnergyAirframe, VehicleModel
from gcs_formation.identify.fitting import DEAD, DEAD_MAX_S, acting
from gcs_formation.identify.identifiability import TAUS
from gcs_formation.identify.output_error import NUDGE, RESOLUTION, STEP_MAX
from gcs_formation.identify.recording import STEP_S, Recording

AIRFRAME_KEYS = (
    "thrust_mps2", "drag_mps2", "heading_gain", "bank_lag_s", "airspeed_lag_s", "time_constant_s", "dead_time_s",
)  # fmt: skip
SPREADS = np.array([0.3, 0.3, 0.3, 0.3, 0.3, 0.1, 0.7])
"""Prior standard deviations of these parameters' logarithms."""
ITERATIONS = 7
MIN_VARIANCE = 1e-9
LOOP_S = 0.02
"""Least value that a search begins with: a period of the autopilot's main loop, for a dead time of 0."""
CORRELATED_S = 2.0
"""Residuals this far apart count as independent in the search."""


def _weighed(errors: Array) -> Array:
    """Return errors of airspeed, heading and height, (3, ...), in units of `RESOLUTION`, as one row."""
    return (errors.reshape(3, -1) / RESOLUTION[:, None]).ravel()


def _nearest(start: Array, errors_of: Callable[[Sequence[Array]], Array], spreads: Array, repeated: float) -> Array:
    """Return the logarithms (P,) of the parameters that fit the measurements best.

    Gauss-Newton, robust: errors beyond one resolution count by their size, not its square. A normal prior about `start`
    holds the parameters.

    Args:
        start: (P,) where the search begins.
        errors_of: returns the weighted errors (T, M) of T sets of logarithms.
        spreads: (P,) prior standard deviations.
        repeated: number of successive errors that carry as much information as one.
    """
    logs = start
    prior: Array = np.diag(spreads**-2.0)
    for _ in range(ITERATIONS):
        error, slopes, weights = _linear(logs, errors_of)
        worth = 1.0 / max(float(np.mean((error * weights) ** 2)) * repeated, MIN_VARIANCE)
        weighed = slopes * weights**2 * worth
        gain = weighed @ error + prior @ (logs - start)
        step = np.linalg.solve(weighed @ slopes.T + prior, gain).astype(np.float64)
        logs = (logs - np.clip(step, -STEP_MAX, STEP_MAX)).astype(np.float64)
    return logs


def _linear(logs: Array, errors_of: Callable[[Sequence[Array]], Array]) -> tuple[Array, Array, Array]:
    """Return the weighted errors (M,) at `logs`, their slopes (P, M) and their robust weights (M,)."""
    errors = errors_of([logs, *(logs + NUDGE * each for each in np.eye(len(logs)))])
    error: Array = errors[0]
    return error, (errors[1:] - error) / NUDGE, 1.0 / np.maximum(np.abs(error), 1.0)


def fit_airframe(recording: Recording, begin: EnergyAirframe, turn_rate_max_rps: float) -> tuple[EnergyAirframe, Array]:
    """Return the airframe that flies a recording's setpoints most alike, and its flight (3, K).

    The search is for the logarithms of `AIRFRAME_KEYS`, held by a normal prior about `begin`.
    """
    start = np.log([max(getattr(begin, name), LOOP_S) for name in AIRFRAME_KEYS])

    def errors_of(tried: Sequence[Array]) -> Array:
        flown = (_flown_by(recording, _with(begin, each), turn_rate_max_rps) for each in tried)
        return np.stack([_weighed(each - recording.seen[:3]) for each in flown])

    logs = _nearest(start, errors_of, SPREADS, CORRELATED_S / STEP_S)
    best = _with(begin, logs)
    return best, _flown_by(recording, best, turn_rate_max_rps)


def time_constants_of(airframe: EnergyAirframe, model: VehicleModel, speed_mps: float) -> VehicleModel:
    """Return the model with the airframe and its time constants for slow changes, by which the law goes.

    An airframe answers steps more slowly, because its energy rates are limited, and quick changes with a larger
    amplitude: neither is a time constant of equation (7).
    """
    speed_s, heading_s, height_s = slow_taus_s(airframe.parameters(), speed_mps)
    time_constants = dict(zip(TAUS, (speed_s, heading_s, height_s / 2, height_s / 2), strict=True))
    rounded = {name: round(each, 3) for name, each in time_constants.items()}
    return model.model_copy(update=rounded | {"airframe": airframe, DEAD: 0.0})


def _with(begin: EnergyAirframe, logs: Array) -> EnergyAirframe:
    values = {name: float(f"{value:.4g}") for name, value in zip(AIRFRAME_KEYS, np.exp(logs).tolist(), strict=True)}
    values[DEAD] = min(values[DEAD], DEAD_MAX_S)
    return begin.model_copy(update=values)


def _flown_by(recording: Recording, airframe: EnergyAirframe, turn_rate_max_rps: float) -> Array:
    """Return sensed airspeed, heading and height, (3, K), of an aircraft under the recorded setpoints."""
    p = airframe.parameters()
    airspeed, heading, height, climb = recording.seen[:, 0].tolist()
    aircraft = energy.Aircraft(height, climb, airspeed, heading)
    energy.trim(aircraft, p)
    setpoints = acting(recording.commanded, recording.delay_s + p.dead_time_s)
    flown = list[tuple[float, float, float]]()
    for speed, direction, up in setpoints.T.tolist():
        flown.append((aircraft.sensed, aircraft.heading_rad, aircraft.height_m))
        bank = math.atan(turn_rate_max_rps * aircraft.speed_mps / energy.GRAVITY_MPS2)
        commanded = energy.Commanded(speed, math.inf, direction, bank, up)
        energy.control(aircraft, commanded, p)
        for _ in range(energy.CYCLES):
            energy.cycle(aircraft, commanded, p)
    return np.array(flown).T
