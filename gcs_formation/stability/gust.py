"""The least error after a gust on one vehicle that any law can achieve: no setpoint acts before the round trip."""

from __future__ import annotations

import math

import numpy as np
import numpy.typing as npt

from formation_scenario.vehicles import VehicleModel
from gcs_formation.arrays import Array

SHARE, SPARE_M = 1.5, 0.05
"""What a law is held to: so many times the least possible, and this much more."""
LOOP_S = 0.02
"""Period of an emulated vehicle's main loop."""
SAME_S = 1e-3
"""Instants that differ by less are the same: clocks aren't known better."""


def least_gust_error_m(gust_mps: npt.ArrayLike, round_trip_s: npt.ArrayLike, accel_max_mps2: npt.ArrayLike) -> Array:
    """Return the least possible maximum error, m, along one axis after a step of relative velocity; shapes broadcast.

    The vehicle is carried for the round trip T, then brakes as hard as it can: |D| T + D^2 / (2 a).

    Args:
        gust_mps: D of (8), the follower's minus the leader's, along that axis.
        round_trip_s: T: uplink, downlink, computation, sampling and hold.
        accel_max_mps2: a, the greatest acceleration.
    """
    gust = np.abs(np.asarray(gust_mps, dtype=np.float64))
    return gust * np.asarray(round_trip_s) + gust**2 / (2.0 * np.asarray(accel_max_mps2))


def met_s(at_s: float) -> float:
    """Return when an emulated vehicle meets a gust that is due at `at_s` of its time: in its main loop's next pass."""
    return LOOP_S * math.ceil(at_s / LOOP_S - SAME_S)


def response_s(begun_s: float, tick_s: Array, stamp_s: Array, up_s: float) -> float:
    """Return T of one gust, s: from its beginning until the first setpoint acts that a sample taken since then led to.

    The round trip in the mean is no bound for one gust: the wait for a sample and for a tick depends on when it begins.

    Args:
        begun_s: when the gust reaches the vehicle.
        tick_s: (T,) instants at which setpoints are decided, in order.
        stamp_s: (T,) when the newest sample at each was taken; NaN where there is none.
        up_s: how long a setpoint is on its way.
    """
    seen = np.flatnonzero((stamp_s >= begun_s - SAME_S) & (tick_s >= begun_s))
    return float(tick_s[seen[0]] + up_s - begun_s) if seen.size else np.nan


def allowed_gust_error_m(gust_mps: npt.ArrayLike, round_trip_s: npt.ArrayLike, accel_max_mps2: npt.ArrayLike) -> Array:
    """Return the maximum error, m, that a law is held to after such a step."""
    return SHARE * least_gust_error_m(gust_mps, round_trip_s, accel_max_mps2) + SPARE_M


def accel_limits_mps2(model: VehicleModel, speed_mps: float) -> tuple[float, float]:
    """Return how hard a vehicle can accelerate along its way and, by turning, across it."""
    return model.accel_max_mps2, speed_mps * model.turn_rate_max_rps
