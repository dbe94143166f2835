"""A clearance offset at one distance at a time, on plain numbers: a uniform cubic B-spline (equations 35 and 36)."""

from __future__ import annotations

from typing import Final

STEP_M: Final = 20.0
"""Distance between knots."""


class OffsetCurve:
    """An offset by its control points, one for each knot and three more."""

    def __init__(self, control_m: list[float]) -> None:
        """Take the control points, at least four."""
        self._control_m = control_m
        self._last_step = float(len(control_m) - 4)

    def at(self, steps: float) -> tuple[float, float, float]:
        """Return the offset in m, its slope and its curvature per m, `steps` knots from its start; constant beyond."""
        index = int(min(max(steps, 0.0), self._last_step))
        u, control_m = min(max(steps - index, 0.0), 1.0), self._control_m
        c0, c1, c2, c3 = control_m[index], control_m[index + 1], control_m[index + 2], control_m[index + 3]
        second = c0 + u * (c1 - c0) - 2.0 * (c1 + u * (c2 - c1)) + c2 + u * (c3 - c2)
        rest = 1.0 - u
        slope = (rest * rest * (c1 - c0) + (1.0 + 2.0 * u * rest) * (c2 - c1) + u * u * (c3 - c2)) / 2.0
        outer = rest * rest * rest * c0 + u * u * u * c3
        inner = (3.0 * u * u * u - 6.0 * u * u + 4.0) * c1 + (3.0 * rest * rest * rest - 6.0 * rest * rest + 4.0) * c2
        return (outer + inner) / 6.0, slope / STEP_M, second / (STEP_M * STEP_M)
