"""Keys of the constant wind."""

from __future__ import annotations

from math import hypot

from formation_scenario.fields import (
    Keys,
    Vector,
    key,
)


class Wind(Keys):
    """Constant wind on all emulated vehicles. `check` plans by it; in flight the station measures its own."""

    velocity_mps: Vector = key((0.0, 0.0, 0.0), "where it blows to: north, east, down, m/s", [3, -2, 0])

    @property
    def speed_mps(self) -> float:
        """Its horizontal speed."""
        return hypot(*self.velocity_mps[:2])
