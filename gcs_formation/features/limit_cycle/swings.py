# Compiled by mypyc: it runs every tick.

"""Swings of one error, and whether they are a limit cycle: as wide and as long, one after the other.

A loop that is unstable by delay or gain grows until a limit of bank or rate holds it, and then goes on with the same
amplitude and period. What gusts, turns and changes of the formation do isn't as regular: of a narrow band of noise the
widths of successive swings differ as Rayleigh's distribution does, by half their mean (standard deviation).
"""

from __future__ import annotations

import math
from typing import Final

AMPLITUDE_M: Final = 1.0
"""Least amplitude. Flights in slots are within 0.2 m, in turbulence within 1 m as a rule; those of a simulated PX4 that
was held up swung by 4 to 5 m. Tuned: m; 0.5 to 3; shown by flights of PX4's simulator."""
SWINGS: Final = 10
"""Swings from one side to the other, five periods, that must be alike. Tuned: half periods; 6 to 20; shown by `pytest
tests/gcs_formation/features/limit_cycle`."""
ALIKE: Final = 0.25
"""Largest difference of any of them from their mean, in width and in time, as a share of it. Tuned: share; 0.15 to 0.4;
shown by `pytest tests/gcs_formation/features/limit_cycle`."""


class Swings:
    """The newest swings of an error."""

    def __init__(self) -> None:
        """Start without any."""
        self._widths_m, self._times_s = list[float](), list[float]()
        self._begun_s = self._at_s = self._max_m = self._from_m = math.nan
        self._side = 0.0
        """1 while it rises, -1 while it falls; 0 at first."""

    def clear(self) -> None:
        """Begin again."""
        self._widths_m.clear()
        self._times_s.clear()
        self._max_m, self._side = math.nan, 0.0

    def add(self, time_s: float, error_m: float) -> None:
        """Take the error at a time, s. It has turned once it is `AMPLITUDE_M` back from its extremum."""
        if math.isnan(self._max_m):
            self._max_m = self._from_m = error_m
            self._at_s = self._begun_s = time_s
        elif self._side == 0.0:
            if abs(error_m - self._max_m) > AMPLITUDE_M:
                self._side = math.copysign(1.0, error_m - self._max_m)
                self._max_m, self._at_s = error_m, time_s
        elif (error_m - self._max_m) * self._side >= 0.0:
            self._max_m, self._at_s = error_m, time_s
        elif (self._max_m - error_m) * self._side > AMPLITUDE_M:
            self._turn(time_s, error_m)

    def _turn(self, time_s: float, error_m: float) -> None:
        """End a swing at its extremum, and begin the one back."""
        self._widths_m.append(abs(self._max_m - self._from_m))
        self._times_s.append(self._at_s - self._begun_s)
        if len(self._widths_m) > SWINGS:
            del self._widths_m[0], self._times_s[0]
        self._from_m, self._begun_s = self._max_m, self._at_s
        self._max_m, self._at_s, self._side = error_m, time_s, -self._side

    def steady(self, time_s: float, *, still: bool) -> bool:
        """Return whether the newest swings are alike and wide enough, and the present one isn't overdue.

        `still`: they were; any swings, half as wide and twice as different, are enough then.
        """
        if len(self._widths_m) < SWINGS or (self.amplitude_m < AMPLITUDE_M and not still):
            return False
        maximum = 2.0 * ALIKE if still else ALIKE
        overdue = time_s - self._begun_s > self.period_s
        return not overdue and _alike(self._widths_m, maximum) and _alike(self._times_s, maximum)

    @property
    def amplitude_m(self) -> float:
        """Half the mean width of the swings, m."""
        return sum(self._widths_m) / len(self._widths_m) / 2.0

    @property
    def period_s(self) -> float:
        """Twice the mean time of the swings, s."""
        return 2.0 * sum(self._times_s) / len(self._times_s)


def _alike(values: list[float], maximum: float) -> bool:
    mean = sum(values) / len(values)
    return all([abs(each - mean) <= maximum * mean for each in values])  # noqa: C419 - compiled, a list costs less
