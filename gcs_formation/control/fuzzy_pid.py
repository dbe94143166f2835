"""The hybrid controller (14) without its feed-forward: a fuzzy scheduler of gains, and PID on arrays.

Five triangular sets centred at -1, -1/2, 0, 1/2 and 1 (the outer two with shoulders), product inference and the
weighted average amount exactly to bilinear interpolation of the tables (errata item 29f).
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import Literal

import numpy as np
import numpy.typing as npt

from flight_model.arrays import Array, Mask, within

LEVELS = {"ZR": 0.0, "PL": 0.5, "PH": 1.0}
SETS = 5

# Rows are the error's rate from NH to PH, columns the error from NH to PH.
TABLE_P = """
PL PH PH PH PH
PL PL PL PL PH
ZR PL PL PL PH
ZR PL PL PL PL
ZR PH PH PH PL
"""
TABLE_I = """
ZR PL PL PL ZR
PL PL PH PL PL
PH PL PH PH PH
PL PL PL PL PL
PL PH PL PL PL
"""
TABLE_D = """
ZR ZR ZR ZR ZR
ZR PL PL PL ZR
PL PL PL PL PL
PH PL PL PL PL
PH PH PH PH PH
"""


def rule_tables(kind: Literal["printed", "symmetric"] = "printed") -> Array:
    """Return (5, 5, 3): F_p, F_i, F_d by rate and error, as printed, or made symmetric in the error's sign (29g)."""
    tables = np.stack([_parse(table) for table in (TABLE_P, TABLE_I, TABLE_D)], axis=-1)
    return tables if kind == "printed" else (tables + tables[::-1, ::-1]) / 2


def _parse(table: str) -> Array:
    return np.array([LEVELS[word] for word in table.split()]).reshape(SETS, SETS)


class FuzzyGainScheduler:
    """Infers how far each gain moves from its base value towards its greatest."""

    def __init__(self, tables: Literal["printed", "symmetric"] = "printed") -> None:
        """Use the tables as printed, or symmetrised."""
        self._table = rule_tables(tables).reshape(SETS * SETS, 3)

    def infer(self, error: npt.ArrayLike, error_rate: npt.ArrayLike) -> Array:
        """Return F_p, F_i, F_d in [0, 1], shape (..., 3), for normalised inputs of any shape (...).

        Inputs outside [-1, 1] are clipped to it.

        Raises:
            ValueError: an input is NaN.
        """
        inputs = np.array((error, error_rate), dtype=np.float64)
        if np.isnan(inputs).any():
            name = "error" if np.isnan(inputs[0]).any() else "error_rate"
            raise ValueError(f"{name}: found nan; allowed: numbers")
        (column, row), (across, down) = _place(inputs)
        corner = row * SETS + column
        across, down = across[..., None], down[..., None]
        upper = self._table[corner] * (1 - across) + self._table[corner + 1] * across
        lower = self._table[corner + SETS] * (1 - across) + self._table[corner + SETS + 1] * across
        return upper * (1 - down) + lower * down


def _place(value: Array) -> tuple[npt.NDArray[np.intp], Array]:
    """Return the index of the cell that a value lies in, and its position in the cell, 0 to 1."""
    position = (within(value, -1.0, 1.0) + 1.0) * ((SETS - 1) / 2)
    cell = np.minimum(position.astype(np.intp), SETS - 2)
    return cell, position - cell


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
