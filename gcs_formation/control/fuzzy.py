"""The fuzzy scheduler of the PID gains: tables 1 to 3 of the paper.

Five triangular sets centred at -1, -1/2, 0, 1/2 and 1 (the outer two with shoulders), product inference and the
weighted average amount exactly to bilinear interpolation of the tables (errata item 29f).
"""

from __future__ import annotations

from typing import Literal

import numpy as np
import numpy.typing as npt

from gcs_formation.arrays import Array, within

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
