"""Margins of loops with prediction against mismatch of delay and of time constants; used shares of margins."""

from __future__ import annotations

import cmath
import math
from bisect import bisect_left
from collections.abc import Callable, Sequence
from functools import cache, lru_cache
from itertools import product
from typing import Final, NamedTuple

import numpy as np

from airlink.clock import rounded
from flight_model.arrays import Array, Complex
from gcs_formation.stability.pid_margins import Loop, Plant, stacked

_GRID = 4000
TAUS_OFF = 0.3
"""Default relative error of every time constant with which mismatch margins of the delay are computed."""
MAXIMUM = 0.95
_STEPS = 10
_HALVINGS = 5
_FREQUENCIES = np.geomspace(1e-3, 1e2, 600)
DEVIATIONS: Final = 2.0
"""The mismatch, in standard deviations of the round trip."""
STEP_S: Final = 0.05
"""Mismatch margins are computed for whole multiples of this delay."""
BANDWIDTHS = tuple(np.geomspace(1.0, 0.1, 33).tolist())
"""Shares to which the bandwidth may be reduced."""
NEAR: Final = 0.8
"""Share of a delay margin from which it is reported that a loop is near it."""
TAUS_OFF_COUNTED: Final = 0.05
"""Smaller relative errors of time constants are ignored."""
TOLERANCE = 4.0 * float(np.finfo(np.float64).eps)
"""Width of a root's final bracket, relative to the root."""
TINY = float(np.finfo(np.float64).smallest_normal)


class MismatchMargin(NamedTuple):
    """True delay minus the predicted one at which stability is lost, s: downwards and upwards.

    -inf and inf if there is no such mismatch; the true delay can't be negative.
    """

    shorter_s: float
    longer_s: float

    def min_s(self) -> float:
        """The smaller of the two, in magnitude."""
        return min(-self.shorter_s, self.longer_s)

    @classmethod
    def of(cls, crossings: Array, nominal_delay_s: float) -> MismatchMargin:
        """Return the margins from all rows (w, w (T - T0)) for which there is a root at iw."""
        if not len(crossings):
            return cls(-np.inf, np.inf)
        w, turned = crossings[:, 0], np.mod(crossings[:, 1], 2.0 * np.pi)
        shorter = float(np.max((turned - 2.0 * np.pi) / w))
        return cls(shorter if shorter >= -nominal_delay_s else -np.inf, float(np.min(turned / w)))


@lru_cache(maxsize=4096)
def predicted_mismatch_margin(loop: Loop, nominal_delay_s: float) -> MismatchMargin:
    """Mismatch of the delay at which the loop with prediction loses stability.

    The state measured T late is predicted over the nominal delay T0 by the exact model and the commands sent:
    x_p = exp(A T0) x(t - T) + int_0^T0 exp(A r) B u(t - r) dr = x + exp(A T0) (x(t - T) - x(t - T0)).
    With T = T0 the loop is that without delay. Otherwise its characteristic equation is
    1 + L + M (exp(-sT) - exp(-sT0)) = 0, L the open loop and M the one with output row c exp(A T0); the first
    mismatch on either side that has a root s = iw is the margin, as the roots move continuously from T = T0.

    Args:
        loop: the loop, stable without delay. For one with complex coefficients, evaluate the conjugate too: only
            roots above 0 rad/s are found.
        nominal_delay_s: the delay that the prediction compensates, without the autopilot's dead time; T0 is their sum.

    Returns:
        Both margins; (0, 0) if the loop is unstable without delay.
    """
    if loop.whole_margin_s() <= 0.0:
        return MismatchMargin(0.0, 0.0)
    whole_s = nominal_delay_s + loop.dead_time_s
    return MismatchMargin.of(mismatch_crossings(loop, whole_s, loop), whole_s)


@cache
def carried(plant: Plant, delay_s: float) -> tuple[complex, complex]:
    """Return the row c exp(A T), which gives the free response of the output after `delay_s` from a state.

    For two states exp(A T) = exp(m T) (cosh(d T) I + sinh(d T) / d (A - m I)), with m +- d the eigenvalues of A.
    """
    state, output = np.array(plant.state, dtype=np.complex128), np.array(plant.output)
    mean = complex(np.trace(state)) / 2.0
    root = cmath.sqrt(mean**2 - complex(state[0, 0] * state[1, 1] - state[0, 1] * state[1, 0]))
    sine_s = cmath.sinh(root * delay_s) / root if root else complex(delay_s)
    row = cmath.cosh(root * delay_s) * output + sine_s * (output @ (state - mean * np.eye(2)))
    first, second = cmath.exp(mean * delay_s) * row
    return complex(first), complex(second)


def mismatch_crossings(loop: Loop, delay_s: float, true: Loop) -> Array:
    """Rows (w, w (T - T0)) for which there is a root at iw; `true` is the loop around the actual autopilot."""
    exact, row = loop.open_loop(), carried(loop.plant, delay_s)
    late, true_late = (each.with_output(row).open_loop() for each in (loop, true))

    def ratio(w: Array) -> Complex:
        behind = np.exp(-1j * w * delay_s)
        return true_late.at(w) * behind / (1.0 + exact.at(w) - late.at(w) * behind)

    def excess(w: Array) -> Array:
        return np.abs(ratio(w)) - 1.0

    grid = np.geomspace(1e-4, 1e3, _GRID)
    above = excess(grid) > 0.0
    (found,) = np.nonzero(above[1:] != above[:-1])
    w = roots_between(excess, grid[found], grid[found + 1])
    return np.column_stack((w, np.angle(-ratio(w))))


def roots_between(function: Callable[[Array], Array], low: Array, high: Array) -> Array:
    """Return a root (n,) of a function of arrays between each low and high (n,), where its signs differ.

    The result is bit-identical to `scipy.optimize.elementwise.find_root`, whose import takes longer than the search.
    Chandrupatla, "A new hybrid quadratic/bisection algorithm for finding the zero of a nonlinear function without using
    derivatives", Advances in Engineering Software 28 (1997): inverse quadratic interpolation where it is safe.
    """
    return np.array([_root(function, *ends) for ends in zip(low.tolist(), high.tolist(), strict=True)])


def _root(function: Callable[[Array], Array], x1: float, x2: float) -> float:
    f1, f2 = (_value(function, x) for x in (x1, x2))
    share = 0.5
    while True:
        x = x1 + share * (x2 - x1)
        f = _value(function, x)
        if np.sign(f) == np.sign(f1):
            x3, f3 = x1, f1
        else:
            x3, f3, x2, f2 = x2, f2, x1, f1
        x1, f1 = x, f
        root, value = (x1, f1) if abs(f1) < abs(f2) else (x2, f2)
        near = abs(root) * TOLERANCE + 4.0 * TINY
        if abs(value) <= TINY or abs(x2 - x1) < near:
            return root
        min_share = 0.5 * near / abs(x2 - x1)
        share = min(max(_interpolated((x1, x2, x3), (f1, f2, f3)), min_share), 1.0 - min_share)


def _value(function: Callable[[Array], Array], x: float) -> float:
    return float(function(np.array([x]))[0])


def _interpolated(x: tuple[float, float, float], f: tuple[float, float, float]) -> float:
    """Return the next point to evaluate, as a share of the distance from the first to the second point."""
    (x1, x2, x3), (f1, f2, f3) = x, f
    xi, phi = (x1 - x2) / (x3 - x2), (f1 - f2) / (f3 - f2) if f3 != f2 else np.inf
    if not 1.0 - np.sqrt(1.0 - xi) < phi < np.sqrt(xi):
        return 0.5
    alpha = (x3 - x1) / (x2 - x1)
    return f1 / (f1 - f2) * f3 / (f3 - f2) - alpha * f1 / (f3 - f1) * f2 / (f2 - f3)


@cache
def tau_margin(loop: Loop, delay_s: float) -> float:
    """Return the relative error, 0 to `MAXIMUM`, that all time constants of the autopilot may have at once.

    The prediction over `delay_s` and the dead time uses the loop's own plant. Every combination of longer and shorter
    time constants is tried, with an error that rises from 0 until one of them is unstable.
    """

    def all_stable(shares: Sequence[float]) -> list[bool]:
        off = [each for share in shares for each in _time_constants_off(loop, share)]
        combinations = len(off) // len(shares)
        stable = predicted_are_stable(loop, off, delay_s + loop.dead_time_s)
        return [all(stable[i : i + combinations]) for i in range(0, len(stable), combinations)]

    shares = np.linspace(0.0, MAXIMUM, _STEPS + 1).tolist()
    unstable = (*all_stable(shares), False).index(False)
    if unstable in {0, len(shares)}:
        return (0.0, *shares)[unstable]
    low, high = shares[unstable - 1], shares[unstable]
    for _ in range(_HALVINGS):
        middle = (low + high) / 2
        low, high = (middle, high) if all_stable([middle])[0] else (low, middle)
    return low


@cache
def mismatch_margin_with_taus_off(loop: Loop, delay_s: float, share: float = TAUS_OFF) -> float:
    """Return the mismatch of the delay, s, at which the predicted loop is unstable with time constants off by `share`.

    It is the least over all combinations of signs; 0 if one is unstable without mismatch of the delay.
    """
    off, whole_s = _time_constants_off(loop, share), delay_s + loop.dead_time_s
    if not all(predicted_are_stable(loop, off, whole_s)):
        return 0.0
    return min(MismatchMargin.of(mismatch_crossings(loop, whole_s, true), whole_s).min_s() for true in off)


def predicted_are_stable(loop: Loop, true: Sequence[Loop], delay_s: float) -> list[bool]:
    """Return whether a loop with prediction is stable around mismatched autopilots, by the Nyquist criterion.

    With P the model's states per setpoint and P' the true ones, the prediction is
    P u + exp(A T) exp(-sT) (P' - P) u, so the characteristic equation is 1 + L + (M' - M) exp(-sT) = 0: L the open loop
    of the model, M and M' those of the model and of the autopilot with output row c exp(A T). Its other poles are in
    the left half-plane or at 0, where a factor s/(s + 1) removes each.

    Args:
        loop: the loop with the model's plant.
        true: the loops with each autopilot's plant.
        delay_s: T.
    """
    model = _on_grid(loop, delay_s)
    row = carried(loop.plant, delay_s)
    true_late = stacked([each.with_output(row).open_loop() for each in true])
    curve = model.returned + (true_late.at(model.w) - model.late) * model.delay
    turned = np.unwrap(np.angle(curve * model.origin))
    return (np.abs(turned[:, -1] - turned[:, 0]) < np.pi / 2).tolist()


class _OnGrid(NamedTuple):
    """The terms of the characteristic equation that depend on the model alone, at frequencies w, rad/s."""

    w: Array
    returned: Complex
    """1 + L."""
    late: Complex
    """M."""
    delay: Complex
    """exp(-sT)."""
    origin: Complex
    """The factors s/(s + 1)."""


@lru_cache(maxsize=1)
def _on_grid(loop: Loop, delay_s: float) -> _OnGrid:
    exact, late = loop.open_loop(), loop.with_output(carried(loop.plant, delay_s)).open_loop()
    directed = np.iscomplexobj(exact.numerator)
    w = np.concatenate((-_FREQUENCIES[::-1], _FREQUENCIES)) if directed else _FREQUENCIES
    s = 1j * w
    origin = (s / (s + 1.0)) ** exact.integrators
    return _OnGrid(w, 1.0 + exact.at(w), late.at(w), np.exp(-s * delay_s), origin)


def _time_constants_off(loop: Loop, share: float) -> list[Loop]:
    """Return the loops around autopilots with time constants off by `share`, in all combinations of signs."""
    return [loop.with_time_constants(*each) for each in product((1.0 - share, 1.0 + share), repeat=loop.plant.taus)]


class LoopDelay:
    """Measured delay of a loop closed over the link, s."""

    def __init__(self, mean_s: float, sigma_s: float) -> None:
        """Take the round trip, sampling and hold included, and its standard deviation."""
        self.mean_s = mean_s
        self.sigma_s = sigma_s


class Usage:
    """Share of their least margin that loops with a common bandwidth use.

    Without prediction, it is the loop's whole delay over the delay margin. With prediction, it is the jitter of the
    delay about its mean, which the prediction compensates, over the mismatch margin of the predicted loop there.
    """

    def __init__(self, loops: Sequence[Loop], *, predicted: bool) -> None:
        """Take the loops at their full bandwidth."""
        self._loops = loops
        self._predicted = predicted
        self._margins_s: dict[tuple[float, int], float] = {}

    def of(self, delay: LoopDelay, bandwidth: float = 1.0) -> float:
        """Return the share of the margin in use at a share of the bandwidth, NaN before the delay is known.

        It is infinite if there is no margin, even for a delay without jitter.
        """
        if math.isnan(delay.mean_s):
            return math.nan
        used_s = DEVIATIONS * delay.sigma_s if self._predicted else delay.mean_s
        return _share(used_s if used_s > 0.0 else 0.0, self.margin_s(delay.mean_s, bandwidth))

    def of_time_constants(self, delay: LoopDelay, off: float) -> float:
        """Return the used share of the margin against wrong time constants; 0 without prediction, which alone uses it.

        `off` is the relative error of the model's time constants.
        """
        if not self._predicted or off < TAUS_OFF_COUNTED or math.isnan(delay.mean_s):
            return 0.0
        delay_s = rounded(delay.mean_s / STEP_S) * STEP_S
        return _share(off, min((tau_margin(loop, delay_s) for loop in self._loops), default=math.inf))

    def bandwidth(self, delay: LoopDelay, max_share: float) -> float:
        """Return the largest of `BANDWIDTHS` at which at most `max_share` of the margin is used; the smallest if none.

        Margins grow as the bandwidth falls.
        """
        index = bisect_left(BANDWIDTHS, True, key=lambda bandwidth: self.of(delay, bandwidth) <= max_share)
        return BANDWIDTHS[min(index, len(BANDWIDTHS) - 1)]

    def margin_s(self, delay_s: float, bandwidth: float = 1.0) -> float:
        """Return the least margin of the loops: of delay, or against mismatch about `delay_s`."""
        step = rounded(delay_s / STEP_S) if self._predicted else 0
        key = bandwidth, step
        margin_s = self._margins_s.get(key)
        if margin_s is None:
            slowed = [loop.slowed(bandwidth) for loop in self._loops]
            of_each = (
                (predicted_mismatch_margin(loop, step * STEP_S).min_s() for loop in slowed)
                if self._predicted
                else (loop.delay_margin_s() for loop in slowed)
            )
            margin_s = self._margins_s[key] = min(of_each, default=math.inf)
        return margin_s


def _share(delay_s: float, margin_s: float) -> float:
    return delay_s / margin_s if margin_s > 0.0 else math.inf


class StatedUsage(Usage):
    """Share of the margin that a law itself states for a loop; it has no gains that could be lowered."""

    def __init__(self, stated_s: Callable[[float], float], *, predicted: bool) -> None:
        """Take what returns the margin, s: of delay, or against mismatch about the predicted delay that it is given.

        It returns NaN if the margin isn't known.
        """
        super().__init__((), predicted=predicted)
        self._stated_s = stated_s

    def of(self, delay: LoopDelay, bandwidth: float = 1.0) -> float:
        """Return the share of the margin in use; NaN if the margin isn't known about this delay."""
        known = math.isnan(delay.mean_s) or not math.isnan(self.margin_s(delay.mean_s, bandwidth))
        return super().of(delay, bandwidth) if known else math.nan

    def of_time_constants(self, delay: LoopDelay, off: float) -> float:  # noqa: ARG002 - as of known loops
        """Return 0: a law states no margin against wrong time constants."""
        return 0.0

    def bandwidth(self, delay: LoopDelay, max_share: float) -> float:  # noqa: ARG002 - as of known loops
        """Return the full bandwidth."""
        return 1.0

    def margin_s(self, delay_s: float, bandwidth: float = 1.0) -> float:
        """Return the stated margin, which a law is asked for once for each multiple of `STEP_S`."""
        step = rounded(delay_s / STEP_S) if self._predicted else 0
        key = bandwidth, step
        margin_s = self._margins_s.get(key)
        if margin_s is None:
            margin_s = self._margins_s[key] = self._stated_s(step * STEP_S)
        return margin_s
