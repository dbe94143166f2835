"""Gusts on followers that don't reach their leader, and bounds on the errors after them that hold for any law."""

from __future__ import annotations

import math
from collections.abc import Iterator
from itertools import pairwise
from typing import NamedTuple

import numpy as np
import numpy.typing as npt

from airlink.endpoint import VehicleId
from flight_model.arrays import Array
from formation_scenario import Vehicle
from formation_scenario.surroundings import StepDisturbance
from gcs_formation.report import RunData

SHARE, SPARE_M = 1.5, 0.05
"""Allowed error: this many times the least possible, and this much more."""
LOOP_S = 0.02
"""Period of an emulated vehicle's main loop."""
SAME_S = 1e-3
"""Instants closer than this are taken as equal: clocks aren't known better."""
MEASURED_OVER_S = 10.0
"""Time before the gust over which the median of the measured delay is taken."""


def min_gust_error_m(gust_mps: npt.ArrayLike, round_trip_s: npt.ArrayLike, accel_max_mps2: npt.ArrayLike) -> Array:
    """Return the least possible maximum error, m, along one axis after a step of relative velocity; shapes broadcast.

    The vehicle is carried for the round trip T, then brakes as hard as it can: |D| T + D^2 / (2 a).

    Args:
        gust_mps: D of (8), the follower's minus the leader's, along that axis.
        round_trip_s: T: uplink, downlink, computation, sampling and hold.
        accel_max_mps2: a, the greatest acceleration.
    """
    gust = np.abs(np.asarray(gust_mps, dtype=np.float64))
    return gust * np.asarray(round_trip_s) + gust**2 / (2.0 * np.asarray(accel_max_mps2))


def gust_acts_s(at_s: float, up_s: float) -> float:
    """Return the mission time at which a gust that is due at `at_s` acts on an emulated vehicle.

    The vehicle has the mission time from a message of the station, which it reads in the first pass of its main loop
    after the message's arrival; by that time the gust acts in the first pass in which it is due.
    """
    return LOOP_S * (math.ceil(at_s / LOOP_S - SAME_S) + math.floor((up_s + SAME_S) / LOOP_S) + 1)


def response_s(begun_s: float, tick_s: Array, stamp_s: Array, up_s: float) -> float:
    """Return T of one gust, s: from its start until the first setpoint acts that follows from a later sample.

    The mean round trip is no bound for a single gust: the wait for a sample and for a tick depends on when it begins.

    Args:
        begun_s: when the gust reaches the vehicle.
        tick_s: (T,) instants at which setpoints are decided, in order.
        stamp_s: (T,) when the newest sample at each was taken; NaN where there is none.
        up_s: delay of the uplink.
    """
    seen = np.flatnonzero((stamp_s >= begun_s - SAME_S) & (tick_s >= begun_s))
    return float(tick_s[seen[0]] + up_s - begun_s) if seen.size else np.nan


def allowed_gust_error_m(gust_mps: npt.ArrayLike, round_trip_s: npt.ArrayLike, accel_max_mps2: npt.ArrayLike) -> Array:
    """Return the maximum error, m, that is allowed after such a step."""
    return SHARE * min_gust_error_m(gust_mps, round_trip_s, accel_max_mps2) + SPARE_M


class GustError(NamedTuple):
    """One follower's error along one slot axis after a gust, until the next one, and its bounds, m."""

    at_s: float
    to_s: float
    vehicle: VehicleId
    axis: str
    round_trip_s: float
    min_m: float
    """|D| T + D² / (2 a): no law can do better."""
    allowed_m: float
    found_m: float


def gusts(run: RunData) -> list[GustError]:
    """Return the errors after each step of the relative velocity between followers and the leading vehicle.

    For each axis: that of the follower nearest to its allowed error, or farthest beyond it. Empty without a real
    leader.
    """
    if not run.begun:
        return []
    end_s = float(run.time_s[-1])
    steps = [each for each in run.scenario.disturbances if isinstance(each, StepDisturbance)]
    starts = {at_s for step in steps for at_s in (step.at_s, step.end_s) if run.time_s[0] <= at_s < end_s}
    return [error for at_s, to_s in pairwise([*sorted(starts), end_s]) for error in _worst(run, at_s, to_s)]


def _worst(run: RunData, at_s: float, to_s: float) -> Iterator[GustError]:
    tick = int(np.searchsorted(run.time_s, at_s - 1e-9))
    leader = run.flown.leader_at(tick)
    if leader is None or run.scenario.formation.frame == "north":  # its axes aren't those of speed and heading
        return
    errors = [
        error
        for vehicle in run.scenario.vehicles
        if vehicle.vehicle_id != leader and (gust_mps := _gust_mps(run, vehicle, leader, at_s)).any()
        for error in _errors(run, vehicle, leader, gust_mps, at_s, to_s)
    ]
    for axis in "xy":
        mine = [error for error in errors if error.axis == axis]
        if mine:
            yield max(mine, key=lambda error: error.found_m / error.allowed_m)


def _gust_mps(run: RunData, vehicle: Vehicle, leader: VehicleId, at_s: float) -> Array:
    """Return by how much a vehicle's disturbance changes at an instant, north and east; 0 if its leader's does too."""
    change = np.zeros(2)
    for step in run.scenario.disturbances:
        hit = run.scenario.selected(step.vehicles)
        if isinstance(step, StepDisturbance) and vehicle in hit and leader not in {v.vehicle_id for v in hit}:
            change += (float(step.at_s == at_s) - float(step.end_s == at_s)) * np.array(step.velocity_mps[:2])
    return change


def _errors(
    run: RunData, vehicle: Vehicle, leader: VehicleId, gust_mps: Array, at_s: float, to_s: float
) -> Iterator[GustError]:
    identity, scenario, tick = vehicle.vehicle_id, run.scenario, int(np.searchsorted(run.time_s, at_s - 1e-9))
    psi = run.flown.heading(leader if scenario.formation.frame == "leader_heading" else identity)[tick]
    along_mps = np.array(((np.cos(psi), np.sin(psi)), (-np.sin(psi), np.cos(psi)))) @ gust_mps
    round_trip_s = _response_s(run, identity, at_s, tick)
    model = vehicle.model
    limits_mps2 = model.accel_max_mps2, scenario.path.begin_mps * model.turn_rate_max_rps
    sizes = np.abs(run.flown.error(identity)[run.flown.window(float(run.time_s[tick]), to_s)])
    for i, axis in enumerate("xy"):
        found_m, gust = float(np.fmax.reduce(sizes[:, i], initial=np.nan)), (along_mps[i], round_trip_s, limits_mps2[i])
        if np.isfinite((psi, round_trip_s, found_m)).all():
            min_m, allowed_m = float(min_gust_error_m(*gust)), float(allowed_gust_error_m(*gust))
            yield GustError(at_s, to_s, identity, axis, round_trip_s, min_m, allowed_m, found_m)


def _response_s(run: RunData, vehicle: VehicleId, at_s: float, tick: int) -> float:
    """Return T of a gust on a vehicle, by the delay measured before it and the samples' own stamps."""
    own, before = run.flown.vehicles[vehicle], max(0, tick - round(MEASURED_OVER_S * run.scenario.law.rate_hz))
    measured_s = own["delay_s"][before : tick + 1]
    known_s = measured_s[np.isfinite(measured_s)]
    if not known_s.size:
        return math.nan
    up_s = float(np.median(known_s))
    return response_s(gust_acts_s(at_s, up_s), run.time_s, run.time_s - own["age_s"], up_s)
