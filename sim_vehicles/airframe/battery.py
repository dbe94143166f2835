"""The battery of an emulated vehicle: it is drained by time and throttle, and lasts on at 0 %."""

from __future__ import annotations

from typing import Final

from airlink.clock import Instant, seconds_between
from formation_scenario.battery import EmulatedBattery
from sim_vehicles.airframe.motion import Motion

MAH_PER_AS: Final = 1.0 / 3.6
EMPTY_V: Final = 3.5
FULL_V: Final = 4.2
CRUISE_THROTTLE: Final = 0.5
"""Throttle in level flight, or in hover."""
CLIMB_THROTTLE: Final = 0.5
"""Throttle that the fastest climb needs beyond that."""


class Battery:
    """What is left of a battery, and what flows."""

    def __init__(self, keys: EmulatedBattery, now: Instant) -> None:
        """Be switched on at `now`."""
        self._keys = keys
        self._at = now
        self.consumed_mah: float = 0.0
        """Taken from it since it was switched on, mAh."""
        self.current_a: float = keys.idle_a
        """What flows now, A."""

    def drain(self, throttle: float, now: Instant) -> None:
        """Take what has flowed since the last time, and let flow from now on what a throttle (0 to 1) needs."""
        keys = self._keys
        self.consumed_mah += self.current_a * seconds_between(self._at, now) * MAH_PER_AS
        self._at = now
        self.current_a = keys.idle_a + (keys.cruise_a - keys.idle_a) * throttle / CRUISE_THROTTLE

    @property
    def share(self) -> float:
        """What is left of its capacity, 0 to 1."""
        keys = self._keys
        return max(keys.charged_percent * 0.01 - self.consumed_mah / keys.capacity_mah, 0.0)

    @property
    def percent(self) -> int:
        """What is left of its capacity in whole percent, rounded down as ArduPilot does."""
        return int(self.share * 100.0)

    @property
    def voltage_v(self) -> float:
        """Its voltage."""
        return self._keys.cells * (EMPTY_V + (FULL_V - EMPTY_V) * self.share)


def throttle_of(motion: Motion, cruise_mps: float, climb_max_mps: float, *, hovers: bool) -> float:
    """Return the throttle, 0 to 1, of a vehicle in flight.

    Drag grows by the square of a fixed wing's airspeed; a climb needs more by its share of the fastest one.
    """
    level = 1.0 if hovers else (motion.airspeed_mps / cruise_mps) ** 2
    needed = CRUISE_THROTTLE * level + CLIMB_THROTTLE * motion.climb_mps / climb_max_mps
    return min(max(needed, 0.0), 1.0)
