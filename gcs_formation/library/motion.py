"""Equation (7): the flight of one vehicle under given setpoints, and its projection through those in flight."""

from __future__ import annotations

import math
from itertools import pairwise
from typing import NamedTuple

import numpy as np
import numpy.typing as npt

from airlink.clock import Instant, nanoseconds
from flight_model.arrays import Array
from flight_model.autopilot_model import advance, within
from flight_model.flight_state import FlightState
from formation_scenario.vehicles import VehicleModel
from gcs_formation.estimation.setpoint_history import SentSetpoints


class Motion(NamedTuple):
    """A vehicle's flight as columns, (n + 1,) each: at its start, and after each of n setpoints."""

    time_s: Array
    north_m: Array
    east_m: Array
    height_m: Array
    climb_mps: Array
    airspeed_mps: Array
    heading_rad: Array


def fly(
    model: VehicleModel,
    setpoints: npt.ArrayLike,
    dt_s: float,
    *,
    start: FlightState | None = None,
    wind_mps: tuple[float, float] = (0.0, 0.0),
) -> Motion:
    """Return the flight of a vehicle that follows setpoints by equation (7), each held for `dt_s`.

    Args:
        model: time constants and limits; no multirotor's.
        setpoints: (n, 3): airspeed, m/s, limited to the model's; heading, rad; height, m.
        dt_s: for how long each is held.
        start: where it begins; default: at the origin, in steady flight by the first setpoint.
        wind_mps: north and east, unless `start` has it.

    Raises:
        ValueError: setpoints of another shape or not finite, a time that isn't positive, or a multirotor.
    """
    rows, autopilot = _rows(setpoints, 3, "setpoints"), _fixed_wing(model).autopilot()
    if not (math.isfinite(dt_s) and dt_s > 0.0):
        raise ValueError(f"dt_s: found {dt_s!r}; allowed: a number > 0")
    speed_mps, heading_rad, height_m = rows[0]
    begun = FlightState(0.0, 0.0, height_m, 0.0, _limited(model, speed_mps), heading_rad, *wind_mps)
    state = begun if start is None else start.copy()
    flown = [state.values()[:6]]
    for speed_mps, heading_rad, height_m in rows:
        advance(state, autopilot, _limited(model, speed_mps), heading_rad, height_m, dt_s)
        flown.append(state.values()[:6])
    north_m, east_m, height, climb_mps, airspeed_mps, heading = np.array(flown, dtype=np.float64).T
    time_s = dt_s * np.arange(len(flown), dtype=np.float64)
    return Motion(time_s, north_m, east_m, height, climb_mps, airspeed_mps, heading)


def project(
    state: FlightState, measured_s: float, sent: npt.ArrayLike, until_s: float, model: VehicleModel
) -> FlightState:
    """Return a measured state carried on to a later time, as before the law acts on it: by (7), through `sent`.

    Args:
        state: as measured, with the wind, which is taken as constant; isn't changed.
        measured_s: when it was.
        sent: (k, 4): when each setpoint acts, s, rising; airspeed, m/s; heading, rad; height, m. Before the first
            acts, the vehicle flies straight on.
        until_s: the time that the state is wanted for: when a setpoint that is sent now will act.
        model: time constants and limits; no multirotor's.

    Raises:
        ValueError: setpoints of another shape, not finite or out of order; a time before `measured_s`; a multirotor.
    """
    rows, carried = _rows(sent, 4, "sent"), state.copy()
    if any(early[0] > late[0] for early, late in pairwise(rows)):
        raise ValueError("sent: found times that fall; allowed: rising times in the first column")
    if not measured_s <= until_s:
        raise ValueError(f"until_s: found {until_s!r}, before measured_s; allowed: {measured_s!r} or later")
    history = SentSetpoints(len(rows) + 1)
    for acts_s, *setpoint in rows:
        history.begin_tick(Instant(nanoseconds(acts_s)))
        history.record((setpoint[0], setpoint[1], setpoint[2]))
    since, until = nanoseconds(measured_s), nanoseconds(until_s)
    history.carry(carried, since, until, _fixed_wing(model).autopilot())
    return carried


def _fixed_wing(model: VehicleModel) -> VehicleModel:
    if model.hovers:
        raise ValueError("model: found a vehicle that hovers; allowed: one that flies by equation (7)")
    return model


def _limited(model: VehicleModel, speed_mps: float) -> float:
    return within(speed_mps, model.speed_min_mps, model.speed_max_mps)


def _rows(values: npt.ArrayLike, width: int, name: str) -> list[list[float]]:
    """Return finite values of shape (n, width), n at least 1, as lists."""
    found = np.asarray(values, dtype=np.float64)
    if found.ndim != 2 or found.shape[1] != width or not len(found):
        raise ValueError(f"{name}: found shape {found.shape}; allowed: (n, {width})")
    if not np.isfinite(found).all():
        raise ValueError(f"{name}: found values that aren't finite; allowed: numbers")
    rows: list[list[float]] = found.tolist()
    return rows
