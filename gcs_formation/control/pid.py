"""The hybrid controller (14) without its feed-forward: PID on arrays with scheduled gains and limited output."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from gcs_formation.arrays import Array, Mask, within


@dataclass(frozen=True)
class Gains:
    """k_p, k_i and k_d, each of any shape that broadcasts to the errors' shape."""

    proportional: Array
    integral: Array
    derivative: Array

    def slowed(self, bandwidth: Array) -> Gains:
        """Return gains for a share of the loop's bandwidth; `stability.PidGains.slowed` gives the reason."""
        return Gains(self.proportional * bandwidth, self.integral * bandwidth**2, self.derivative * bandwidth)


@dataclass(frozen=True)
class PidState:
    """What the controllers remember, in the errors' shape."""

    integral: Array
    """Integral of k_i(t) e dt: a change of gain doesn't kick the output (errata item 29b)."""
    rate: Array
    """Filtered rate of the error, a second."""

    @classmethod
    def at_rest(cls, shape: tuple[int, ...]) -> PidState:
        """Return the state of controllers at the start, with their integrators at trim (29)."""
        return cls(np.zeros(shape), np.zeros(shape))

    def with_integral(self, integral: Array, which: Mask) -> PidState:
        """Return this state with some of the integrals replaced by earlier ones."""
        return PidState(np.where(which, integral, self.integral), self.rate)


def filter_rate(state: PidState, slope: Array, filter_s: float, dt_s: float) -> Array:
    """Return the error's rate behind the filter 1/(T s + 1), exact for a `slope` that holds for `dt_s`."""
    kept = np.exp(-dt_s / filter_s)
    return kept * state.rate + (1 - kept) * slope


def unlimited(state: PidState, gains: Gains, error: Array, rate: Array) -> Array:
    """Return the controllers' output before any limit."""
    return gains.proportional * error + state.integral + gains.derivative * rate


def integrate(
    state: PidState, gains: Gains, error: Array, rate: Array, excess: Array, anti_windup_s: float, dt_s: float
) -> PidState:
    """Return the state after `dt_s`; `excess` (limited minus unlimited output) decays with `anti_windup_s` (29c).

    This back-calculation takes from an integral what it has gathered, and no more: what it put in beyond that could
    leave by the integral gain only, which may be 0.
    """
    grown = state.integral + gains.integral * error * dt_s
    unwound = grown + excess * (dt_s / anti_windup_s)
    return PidState(within(unwound, np.minimum(grown, 0.0), np.maximum(grown, 0.0)), rate)
