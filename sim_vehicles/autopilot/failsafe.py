"""An emulated vehicle's failsafe for the end of the ground station's heartbeats.

Source: ArduPilot documentation, "Plane Failsafe Function" and "GCS Failsafe" of ArduCopter.
"""

from __future__ import annotations

from collections.abc import Mapping
from typing import Final, NamedTuple

from airlink.clock import NEVER, Instant, after
from sim_vehicles.autopilot.modes import CopterMode, FlightMode, Mode
from sim_vehicles.autopilot.parameters import ParameterServer

ACTIONS = {1: Mode.RTL, 2: Mode.FBWA, 4: Mode.AUTO, 5: Mode.AUTOLAND}
"""FS_LONG_ACTN: return, glide, AUTO, land; all others fly on."""


class FailsafeKeys(NamedTuple):
    """Names of a family's parameters for the failsafe, and the modes that its actions are."""

    enabled: str
    timeout_s: str
    action: str
    actions: Mapping[int, FlightMode]


LONG_FAILSAFE = FailsafeKeys("FS_GCS_ENABL", "FS_LONG_TIMEOUT", "FS_LONG_ACTN", ACTIONS)
COPTER_ACTIONS = dict.fromkeys((1, 2, 3, 4, 6), CopterMode.RTL) | {5: CopterMode.LAND, 7: CopterMode.BRAKE}
"""FS_GCS_ENABLE: RTL, also for SmartRTL and AUTO, which have nothing to go by; LAND; BRAKE."""
COPTER_FAILSAFE = FailsafeKeys("FS_GCS_ENABLE", "FS_GCS_TIMEOUT", "FS_GCS_ENABLE", COPTER_ACTIONS)
STALE: Final = -1
"""Number of changed parameters for which nothing is known yet."""


class GroundStationFailsafe:
    """Triggers once when heartbeats of MAV_GCS_SYSID stop. New heartbeats clear it, but don't restore the mode."""

    def __init__(self, parameters: ParameterServer, keys: FailsafeKeys) -> None:
        """Wait for a first heartbeat."""
        self._parameters, self._keys = parameters, keys
        self._heard: Instant | None = None
        self.active = False
        self._deadline, self._known = NEVER, STALE
        """When it triggers, as found when so many of the parameters had been set."""

    def heartbeat(self, system: int, now: Instant) -> None:
        """Take a heartbeat."""
        if system == self._parameters["MAV_GCS_SYSID"]:
            self._heard, self._known = now, STALE
            self.active = False

    def deadline(self) -> Instant:
        """Return when it triggers, `NEVER` while it can't."""
        if self._known != self._parameters.changes:
            self._deadline, self._known = self._found(), self._parameters.changes
        return self._deadline

    def _found(self) -> Instant:
        if self._heard is None or self.active or not self._parameters[self._keys.enabled]:
            return NEVER
        return after(self._heard, self._parameters[self._keys.timeout_s])

    def due_mode(self, now: Instant) -> FlightMode | None:
        """Return the mode to change to if it triggers now."""
        if now < self.deadline():
            return None
        self.active, self._known = True, STALE
        return self._keys.actions.get(int(self._parameters[self._keys.action]))
