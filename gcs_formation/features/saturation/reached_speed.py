# Compiled by mypyc: it runs every tick.

"""The speed over ground at which a multirotor is saturated, by its commanded and flown velocities."""

from __future__ import annotations

import math
from typing import Final

CHECK_S: Final = 0.4
"""Interval of the checks. Tuned: s; 0.2 to 0.8; shown by `pytest tests/gcs_formation/features/saturation`."""
CHECKS: Final = 4
"""Consecutive checks, three intervals, in which it must be too slow. The time constants of multirotors are 0.4 to
0.7 s. Tuned: checks; 4 to 8; shown by `pytest tests/gcs_formation/features/saturation`."""
SHORT_MPS: Final = 0.4
"""Speed that it must lack in each of them. Tuned: m/s; 0.3 to 1; shown by `pytest
tests/gcs_formation/features/saturation`."""
GAINED: Final = 0.3
"""Share of what it lacked that one which isn't saturated gains meanwhile. Tuned: share; 0.15 to 0.5; shown by `pytest
tests/gcs_formation/features/saturation`."""
FLIES: Final = 0.3
"""Share of its commanded speed that it must fly: one that doesn't fly at all isn't waited for. Tuned: share; 0.2 to
0.5; shown by `pytest tests/gcs_formation/features/saturation`."""
FORGETS_MPS2: Final = 0.05
"""Rate at which the limit rises again. Tuned: m/s²; 0.02 to 0.2; shown by `pytest
tests/gcs_formation/features/saturation`."""
Velocity = tuple[float, float]
"""Over ground, north and east, m/s."""


class ReachedSpeed:
    """One multirotor's limit."""

    def __init__(self, fastest_mps: float) -> None:
        """Begin without a limit; `fastest_mps`: its model's, from which on one is none."""
        self._fastest_mps = fastest_mps
        self.max_mps = math.inf
        """The greatest speed over ground that it reaches at present, m/s."""
        self.saturated = False
        """Whether it was at its limit at the last check."""
        self._lacked_mps, self._flown_mps = list[float](), list[float]()

    def pause(self) -> None:
        """It isn't commanded: what it flies says nothing."""
        self.saturated = False
        self._lacked_mps.clear()
        self._flown_mps.clear()

    def check(self, commanded: Velocity, flown: Velocity) -> None:
        """Take its velocity, and the one that it was commanded when it flew that."""
        speed_mps = math.hypot(commanded[0], commanded[1])
        along_mps = 0.0 if speed_mps == 0.0 else (commanded[0] * flown[0] + commanded[1] * flown[1]) / speed_mps
        if not (speed_mps - along_mps >= SHORT_MPS and along_mps >= FLIES * speed_mps):  # NaN: it wasn't commanded
            self.pause()
        else:
            self._lacked_mps.append(speed_mps - along_mps)
            self._flown_mps.append(along_mps)
        if len(self._flown_mps) > CHECKS:
            del self._lacked_mps[0], self._flown_mps[0]
        self.saturated = len(self._flown_mps) == CHECKS and (
            self._flown_mps[-1] - self._flown_mps[0] < GAINED * self._lacked_mps[0]
        )
        if self.saturated:
            self.max_mps = sum(self._flown_mps) / CHECKS
        elif self.max_mps < self._fastest_mps:
            self.max_mps += FORGETS_MPS2 * CHECK_S
        else:
            self.max_mps = math.inf
