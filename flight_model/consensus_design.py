"""Gains of the consensus protocol (3) by loop shaping on the aircraft's response, as `gain_design` does for a PID.

A graph's mode of eigenvalue lambda closes the loop tau (lambda (k1/s + k2) + k3 - 1/tau) P(s), along the heading and
across it: P is the aircraft's response to its setpoint, and tau the lag of model (7) by which (3) is sent. The common
motion is the mode of eigenvalue 0. An airspeed under total-energy control answers quick changes of its setpoint with
several times their size, so nothing of velocities may be fed back along the heading: k2 is 0, and k3 is 1/tau_v, the
damping that an airspeed has by itself. Across the heading, where lags are longer, that k3 damps. k1 is the largest at
which every mode holds the bounds. Peaks are those with the states predicted over the links' delay; of the delay margin
nothing counts as predicted.
"""

from __future__ import annotations

from collections.abc import Sequence
from typing import NamedTuple

import numpy as np

from flight_model.arrays import Complex
from flight_model.gain_design import (
    BANDWIDTHS,
    DELAY_MARGIN_S,
    FREQUENCIES,
    MISMATCH_PEAK,
    PAIR,
    PEAK,
    STEPS,
    late,
    mismatched,
    stable_delay_s,
)
from flight_model.slot import Triple


class Axis(NamedTuple):
    """One setpoint of a vehicle."""

    lag_s: float
    """Of its model (7)."""
    response: Complex
    """Of the vehicle, at `FREQUENCIES`."""
    steps_mps: float
    """Largest standard deviation of a tick's setpoint step, as a speed."""

    @classmethod
    def along(cls, lag_s: float, response: Complex) -> Axis:
        """Return that of the airspeed."""
        return cls(lag_s, response, STEPS[0])

    @classmethod
    def across(cls, lag_s: float, response: Complex, speed_mps: float) -> Axis:
        """Return that of the heading, at an airspeed."""
        return cls(lag_s, response, STEPS[1] * speed_mps)


class Delays(NamedTuple):
    """Of the loops, s."""

    sampling_s: float
    """Sampling and hold."""
    links_s: float
    """Both ways."""


def consensus_gains(
    vehicles: Sequence[tuple[Axis, Axis]], eigenvalues: Sequence[complex], position_m: float, delays: Delays
) -> Triple:
    """Return k1 in 1/s^2, k2 and k3 in 1/s; k1 is the least that is tried where no other holds the bounds.

    Args:
        vehicles: each kind's axes, along and across.
        eigenvalues: of the graph's Laplacian.
        position_m: noise of a position, standard deviation.
        delays: of the loops.
    """
    modes = sorted({0j, *np.round(np.asarray(eigenvalues, np.complex128), 6).tolist()}, key=abs, reverse=True)
    largest, axes = max(abs(modes[0]), 1.0), [axis for each in vehicles for axis in each]
    quiet = min(axis.steps_mps / axis.lag_s for axis in axes) / (PAIR * position_m)
    dampings = sorted({1.0 / along.lag_s for along, _ in vehicles}, reverse=True)
    tried = [(float(k) / largest, k3) for k in BANDWIDTHS if k <= quiet for k3 in dampings]
    tried.append((float(BANDWIDTHS[-1]) / largest, dampings[0]))
    holds = (gains for gains in tried if all(_holds(*gains, axis, mode, delays) for mode in modes for axis in axes))
    k1, k3 = next(holds, tried[-1])
    return k1, 0.0, k3


def _holds(k1: float, k3: float, axis: Axis, mode: complex, delays: Delays) -> bool:
    """Return whether a mode's loop on an axis holds the bounds, also around responses that aren't as known."""
    s = 1j * FREQUENCIES
    controller = (axis.lag_s * (mode * k1 / s + k3) - 1.0) * late(delays.sampling_s)
    integrators = 1 if mode else 0
    if not _stands(controller * axis.response, integrators, PEAK, DELAY_MARGIN_S + delays.links_s):
        return False
    return all(_stands(loop, integrators, MISMATCH_PEAK, 0.0) for loop in mismatched(controller, axis.response))


def _stands(loop: Complex, integrators: int, peak: float, least_s: float) -> bool:
    margin_s = stable_delay_s(loop, integrators)
    return margin_s > 0.0 and margin_s >= least_s and float(np.max(1.0 / np.abs(1.0 + loop))) <= peak
