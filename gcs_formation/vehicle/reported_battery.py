# Compiled by mypyc: telemetry fills it.

"""What a vehicle reports of its battery: SYS_STATUS, and BATTERY_STATUS of its first one.

Source: MAVLink's common message set. -1 stands for an unknown charge or current, 0 for an unknown time.
"""

from __future__ import annotations

import math
from typing import Final

from mypy_extensions import mypyc_attr

from airlink.messages.telemetry import BatteryStatus, SysStatus

UNKNOWN: Final = -1
FULL_PERCENT: Final = 100
MIN_V: Final = 0.5
"""A battery of a lower voltage isn't measured: autopilots without a battery monitor may report 0 % with 0 V."""


@mypyc_attr(acyclic=True)
class ReportedBattery:
    """The newest values, and what isn't known as NaN."""

    def __init__(self) -> None:
        """Start with nothing known."""
        self.left: float = math.nan
        """Share of its capacity that is left, 0 to 1."""
        self.voltage_v: float = math.nan
        self.current_a: float = math.nan
        self.consumed_mah: float = math.nan
        """What has been taken from it since it was connected, mAh."""
        self.lasts_s: float = math.nan
        """For how long it lasts by the autopilot's own estimate, s."""

    def take(self, message: SysStatus | BatteryStatus) -> None:
        """Take it; of several batteries in BATTERY_STATUS the first counts, which SYS_STATUS has too."""
        if isinstance(message, SysStatus):
            self.voltage_v = message.voltage_battery_v
            self.current_a = _known(message.current_battery_a)
            self._charge(message.battery_remaining)
        elif message.id == 0:
            self.current_a = _known(message.current_battery_a)
            self.consumed_mah = _known(float(message.current_consumed))
            self.lasts_s = float(message.time_remaining) if message.time_remaining > 0 else math.nan
            self._charge(message.battery_remaining)

    def _charge(self, percent: int) -> None:
        known = UNKNOWN < percent <= FULL_PERCENT and not self.voltage_v < MIN_V
        self.left = percent * 0.01 if known else math.nan


def _known(value: float) -> float:
    return value if value >= 0.0 else math.nan
