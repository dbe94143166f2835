"""A monitor: says when a follower leaves its slot."""

import math

from pydantic import BaseModel, Field

from gcs_formation.extend import Cycle, Monitor, register_monitor


@register_monitor("in_slot")  # extensions: {in_slot: {within_m: 2}}
class InSlot(Monitor):
    """Raises an event for a follower that is farther from its slot than allowed."""

    class Keys(BaseModel):
        """`extensions.in_slot`."""

        within_m: float = Field(default=2.0, gt=0.0)

    def watch(self, cycle: Cycle) -> None:
        """Look at each follower's error; before the path they are still coming."""
        for vehicle in cycle.vehicles:
            off_m = math.hypot(*vehicle.error_m)
            if cycle.mission_time_s >= 0.0 and off_m > self.keys.within_m:
                cycle.event("in_slot", f"left its slot by more than {self.keys.within_m:g} m", vehicle, off_m=off_m)
