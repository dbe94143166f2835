"""The ground-station failsafe: off unless FS_GCS_ENABL is set.

Source: ArduPilot documentation, "Plane Failsafe Function".
"""

from __future__ import annotations

from airlink.clock import Instant, after
from sim_vehicles.loop import NEVER
from sim_vehicles.modes import Mode
from sim_vehicles.parameters import ParameterServer

ACTIONS = {1: Mode.RTL, 2: Mode.FBWA, 4: Mode.AUTO}
"""FS_LONG_ACTN: return, glide, AUTO; 0 and 3 fly on."""


class GroundStationFailsafe:
    """Triggers once when heartbeats of MAV_GCS_SYSID stop. New heartbeats clear it, but don't restore the mode."""

    def __init__(self, parameters: ParameterServer) -> None:
        """Wait for a first heartbeat."""
        self._parameters = parameters
        self._heard: Instant | None = None
        self.active = False

    def heartbeat(self, system: int, now: Instant) -> None:
        """Take a heartbeat."""
        if system == self._parameters["MAV_GCS_SYSID"]:
            self._heard = now
            self.active = False

    def deadline(self) -> Instant:
        """Return when it triggers, `NEVER` while it can't."""
        if self._heard is None or self.active or not self._parameters["FS_GCS_ENABL"]:
            return NEVER
        return after(self._heard, self._parameters["FS_LONG_TIMEOUT"])

    def strike(self, now: Instant) -> Mode | None:
        """Return the mode to change to if it triggers now."""
        if now < self.deadline():
            return None
        self.active = True
        return ACTIONS.get(int(self._parameters["FS_LONG_ACTN"]))
