"""The least error after a gust on one vehicle that any law can achieve: no setpoint acts before the round trip."""

from __future__ import annotations

import numpy as np
import numpy.typing as npt

from formation_scenario.vehicles import VehicleModel
from gcs_formation.arrays import Array

SHARE, SPARE_M = 1.5, 0.05
"""What a law is held to: so many times the least possible, and this much more."""


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


def allowed_gust_error_m(gust_mps: npt.ArrayLike, round_trip_s: npt.ArrayLike, accel_max_mps2: npt.ArrayLike) -> Array:
    """Return the maximum error, m, that a law is held to after such a step."""
    return SHARE * least_gust_error_m(gust_mps, round_trip_s, accel_max_mps2) + SPARE_M


def accel_limits_mps2(model: VehicleModel, speed_mps: float) -> tuple[float, float]:
    """Return how hard a vehicle can accelerate along its way and, by turning, across it."""
    return model.accel_max_mps2, speed_mps * model.turn_rate_max_rps
