"""A pilot's choice of mode where each setpoint commands the guided mode, and so undoes it within a tick."""

from __future__ import annotations

from gcs_formation.vehicle.command_effect import SHOWN_IN_HEARTBEATS
from gcs_formation.vehicle.telemetry import Telemetry


class PilotsChoice:
    """Remembers a mode that was seen between setpoints, until the vehicle has it again.

    Setpoints stop, and the mode is commanded once more: it arrives after the last of them. Two heartbeats after it is
    acknowledged the vehicle's mode is the pilot's again, or the pilot has given the vehicle back.
    """

    def __init__(self) -> None:
        """Start with no choice."""
        self.mode: int | None = None
        self._heartbeats = 0

    def see(self, mode: int, guided_mode: int, seen: Telemetry) -> None:
        """Take the mode of a vehicle that gets setpoints."""
        if mode != guided_mode:
            self.mode, self._heartbeats = mode, seen.heartbeats

    def stands(self, seen: Telemetry, *, waiting: bool) -> bool:
        """Return whether the guided mode that heartbeats show may be the setpoints' doing; `waiting`: on an answer."""
        if self.mode is not None and waiting:
            self._heartbeats = seen.heartbeats
        elif seen.heartbeats >= self._heartbeats + SHOWN_IN_HEARTBEATS:
            self.mode = None
        return self.mode is not None
