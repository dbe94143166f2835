"""How far the lags of an autopilot may be from those of the model that a loop's prediction goes by."""

from __future__ import annotations

from functools import cache
from itertools import product

import numpy as np
import numpy.typing as npt

from gcs_formation.stability.loops import Loop, Rational
from gcs_formation.stability.prediction import MismatchMargin, carried, mismatch_crossings

LAGS_OFF = 0.3
"""By what share of itself every lag may be off where the mismatch of the delay is given for that."""
MOST = 0.95
_STEPS = 10
_HALVINGS = 5
_GRID = np.geomspace(1e-3, 1e2, 600)


@cache
def lag_margin(loop: Loop, delay_s: float) -> float:
    """Return by what share of itself every lag of the autopilot may be off at once, 0 to `MOST`.

    The prediction bridges `delay_s` with the loop's own plant. Every combination of longer and shorter lags is
    tried, at a share that rises from 0 until one of them is unstable.
    """
    signs = _signs(loop)

    def stands(share: float) -> bool:
        return all(
            predicted_is_stable(loop, loop.with_lags(*(1.0 + share * sign for sign in way)), delay_s) for way in signs
        )

    if not stands(0.0):
        return 0.0
    low, high = 0.0, MOST
    for share in np.linspace(0.0, MOST, _STEPS + 1)[1:].tolist():
        if not stands(share):
            high = share
            break
        low = share
    for _ in range(_HALVINGS if high > low else 0):
        middle = (low + high) / 2
        low, high = (middle, high) if stands(middle) else (low, middle)
    return low


@cache
def mismatch_margin_with_lags_off(loop: Loop, delay_s: float, share: float = LAGS_OFF) -> float:
    """Return the mismatch of the delay, s, at which the predicted loop loses stability with lags off by up to `share`.

    The least over all combinations; 0 where one of them is unstable without any mismatch of the delay.
    """
    least = np.inf
    for way in _signs(loop):
        true = loop.with_lags(*(1.0 + share * sign for sign in way))
        if not predicted_is_stable(loop, true, delay_s):
            return 0.0
        least = min(least, MismatchMargin.of(mismatch_crossings(loop, delay_s, true), delay_s).least())
    return least


def predicted_is_stable(loop: Loop, true: Loop, delay_s: float) -> bool:
    """Return whether a loop with prediction is stable around an autopilot that isn't its model's, by Nyquist's count.

    With P the model's states per setpoint and P' the true ones, the prediction is
    P u + exp(A T) exp(-sT) (P' - P) u, so the characteristic equation is 1 + L + (M' - M) exp(-sT) = 0: L the open loop
    of the model, M and M' those of the model and of the autopilot with output row c exp(A T). All other poles of it lie
    on the left or at 0, where a factor s/(s + 1) takes each away.

    Args:
        loop: with the model's plant.
        true: with the autopilot's.
        delay_s: T.
    """
    exact, row = loop.open_loop(), carried(loop.plant, delay_s)
    late, true_late = (each.with_output(row).open_loop() for each in (loop, true))
    at_origin = _poles_at_origin(exact)
    directed = np.iscomplexobj(exact.numerator)
    w = np.concatenate((-_GRID[::-1], _GRID)) if directed else _GRID
    s = 1j * w
    curve = 1.0 + exact.at(w) + (true_late.at(w) - late.at(w)) * np.exp(-s * delay_s)
    turned = np.unwrap(np.angle(curve * (s / (s + 1.0)) ** at_origin))
    return bool(abs(turned[-1] - turned[0]) < np.pi / 2)


def _signs(loop: Loop) -> list[tuple[int, ...]]:
    return list(product((-1, 1), repeat=loop.plant.lags))


def _poles_at_origin(open_loop: Rational) -> int:
    values: npt.NDArray[np.float64] = np.abs(open_loop.denominator)
    return len(values) - len(np.trim_zeros(values, "b"))
