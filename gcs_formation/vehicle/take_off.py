"""Where a vehicle stood before its take-off, and the course of that: AUTOLAND lands there, on the same course."""

from __future__ import annotations

import math
from dataclasses import dataclass

from gcs_formation.vehicle.telemetry import Motion, Telemetry

UP_M = 5.0


@dataclass
class TakeOff:
    """What was seen of a take-off; nothing if the vehicle was in the air before."""

    stood: Motion | None = None
    """Where it was before it was armed."""
    course_rad: float | None = None

    def watch(self, seen: Telemetry) -> None:
        """Look at a new position."""
        motion = seen.motion
        if motion is None or seen.heartbeat is None:
            return
        if not seen.armed:
            self.stood, self.course_rad = motion, None
        elif self.stood is not None and self.course_rad is None and motion.above_home_m > UP_M:
            self.course_rad = math.atan2(motion.east_mps, motion.north_mps)
