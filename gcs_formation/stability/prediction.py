"""How large an error of the assumed delay a loop with prediction through the autopilot model (7) can have."""

from __future__ import annotations

from functools import cache
from typing import NamedTuple

import numpy as np
import numpy.typing as npt
from scipy.linalg import expm
from scipy.optimize import elementwise

from gcs_formation.arrays import Array
from gcs_formation.stability.loops import Loop, Plant, delay_margin

_GRID = 4000


class MismatchMargin(NamedTuple):
    """True delay minus the predicted one at which stability is lost, s: downwards and upwards.

    -inf and inf where no such mismatch exists; the true delay itself can't be below 0.
    """

    shorter_s: float
    longer_s: float

    def least(self) -> float:
        """The smaller of the two, in magnitude."""
        return min(-self.shorter_s, self.longer_s)

    @classmethod
    def of(cls, crossings: Array, nominal_delay_s: float) -> MismatchMargin:
        """Return the margins by all rows (w, w (T - T0)) that put a root at iw."""
        if not len(crossings):
            return cls(-np.inf, np.inf)
        w, turned = crossings[:, 0], np.mod(crossings[:, 1], 2.0 * np.pi)
        shorter = float(np.max((turned - 2.0 * np.pi) / w))
        return cls(shorter if shorter >= -nominal_delay_s else -np.inf, float(np.min(turned / w)))


def predicted_mismatch_margin(loop: Loop, nominal_delay_s: float) -> MismatchMargin:
    """Mismatch of the delay at which the loop with prediction loses stability.

    The state measured T late is carried over the nominal delay T0 by the exact model and the commands sent:
    x_p = exp(A T0) x(t - T) + int_0^T0 exp(A r) B u(t - r) dr = x + exp(A T0) (x(t - T) - x(t - T0)).
    With T = T0 the loop is that without delay. Otherwise its characteristic equation is
    1 + L + M (exp(-sT) - exp(-sT0)) = 0, L the open loop and M the one with output row c exp(A T0); the first
    mismatch on either side that has a root s = iw is the margin, as the roots move continuously from T = T0.

    Args:
        loop: the loop, stable without delay. Of one with complex coefficients, take the conjugate's too: only
            roots above 0 rad/s are looked for.
        nominal_delay_s: T0, the delay that the prediction bridges.

    Returns:
        Both margins; (0, 0) when the loop is unstable without delay.
    """
    if delay_margin(loop.open_loop()) <= 0.0:
        return MismatchMargin(0.0, 0.0)
    return MismatchMargin.of(mismatch_crossings(loop, nominal_delay_s, loop), nominal_delay_s)


@cache
def carried(plant: Plant, delay_s: float) -> tuple[complex, complex]:
    """Return the row c exp(A T) that takes a state to the output that it leaves after `delay_s`."""
    first, second = np.array(plant.output) @ expm(np.array(plant.state) * delay_s)
    return complex(first), complex(second)


def mismatch_crossings(loop: Loop, delay_s: float, true: Loop) -> Array:
    """Rows (w, w (T - T0)) that put a root at iw; `true` is the loop with the autopilot that is really there."""
    exact, row = loop.open_loop(), carried(loop.plant, delay_s)
    late, true_late = (each.with_output(row).open_loop() for each in (loop, true))

    def ratio(w: Array) -> npt.NDArray[np.complex128]:
        behind = np.exp(-1j * w * delay_s)
        return true_late.at(w) * behind / (1.0 + exact.at(w) - late.at(w) * behind)

    def excess(w: Array) -> Array:
        return np.abs(ratio(w)) - 1.0

    grid = np.geomspace(1e-4, 1e3, _GRID)
    above = excess(grid) > 0.0
    (found,) = np.nonzero(above[1:] != above[:-1])
    w = np.asarray(elementwise.find_root(excess, (grid[found], grid[found + 1])).x, dtype=np.float64)
    return np.column_stack((w, np.angle(-ratio(w))))
