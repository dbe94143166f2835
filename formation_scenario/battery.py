"""Keys of an emulated vehicle's battery."""

from __future__ import annotations

from typing import Annotated

from pydantic import Field

from formation_scenario.fields import Keys, NonNegative, Number, Positive, key

Percent = Annotated[Number, Field(ge=0.0, le=100.0)]
Cells = Annotated[int, Field(strict=True, ge=1, le=14)]


class EmulatedBattery(Keys):
    """A battery that is drained by time and throttle, and reported in SYS_STATUS and BATTERY_STATUS."""

    capacity_mah: Annotated[Positive, Field(ge=10.0, le=1e6)] = key(5000.0, "its capacity, mAh", 8000)
    charged_percent: Percent = key(100.0, "how much of it is left when the vehicle is switched on, %", 80)
    cruise_a: Positive = key(
        10.0, "current in level flight at the path's speed, or in hover, A; more to climb and to fly faster", 15
    )
    idle_a: NonNegative = key(0.5, "current without throttle, A", 0.3)
    cells: Cells = key(4, "cells in series, of 3.5 V empty to 4.2 V full", 6)
