"""Aids: sensors that bound an inertial navigator's errors."""

from __future__ import annotations

from typing import NamedTuple

import numpy as np

from formation_scenario.arrays import Array
from sim_vehicles.estimate import InnovationRatios
from sim_vehicles.inertial.error_model import PLACE, SIZE, UP

RECEIVED = 6
GATE = 5.0


class Aid(NamedTuple):
    """A sensor that measures part of the position and velocity, with independent white errors."""

    rate_hz: float
    seen: Array
    """(M, 15) measurement matrix: which of the errors each measurement contains."""
    sigmas: Array
    """(M,) standard deviations, m and m/s."""

    @property
    def has_position(self) -> bool:
        """Whether it is a receiver: it measures places and velocities east, north and up, in this order."""
        return self.sigmas.size == RECEIVED

    def test_ratios(self, innovation: Array) -> InnovationRatios:
        """Return normalised innovations (M,) as shares of ArduPilot's gates, 5 standard deviations (EK3_POS_I_GATE)."""
        shares: list[float] = (np.abs(innovation) / GATE).tolist()
        if not self.has_position:
            return InnovationRatios(0.0, 0.0, shares[0], 0.0)
        east, north, up, *velocity = shares
        return InnovationRatios(max(velocity), max(east, north), up, 0.0)


def gnss(rate_hz: float, position_sigma_m: float, height_sigma_m: float, velocity_sigma_mps: float) -> Aid:
    """Return a GNSS receiver: position and velocity, loosely coupled (Groves, 2013, section 14.1.2)."""
    sigmas = (position_sigma_m, position_sigma_m, height_sigma_m, *(velocity_sigma_mps,) * 3)
    return Aid(rate_hz, np.eye(6, SIZE), np.array(sigmas))


def barometer(rate_hz: float, height_sigma_m: float) -> Aid:
    """Return a barometric altimeter: the height alone."""
    return Aid(rate_hz, np.eye(SIZE)[PLACE][[UP]], np.array((height_sigma_m,)))
