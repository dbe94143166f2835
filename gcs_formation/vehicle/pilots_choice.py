"""The mode that a vehicle's pilot chose while setpoints were on their way to it."""

from __future__ import annotations

from gcs_formation.vehicle.command_delivery import SHOWN_IN_HEARTBEATS
from gcs_formation.vehicle.telemetry import Telemetry


class PilotsChoice:
    """Remembers a pilot's choice of mode made between setpoints that command the guided mode.

    Setpoints then stop, and the pilot's mode is commanded once more, so that it arrives after the last setpoint. Two
    heartbeats after its acknowledgement the vehicle is in that mode, or the pilot has handed the vehicle back.
    """

    def __init__(self) -> None:
        """Start with no choice."""
        self.mode: int | None = None
        """The pilot's mode; while it is set, a guided mode in heartbeats may be due to our setpoints."""
        self._heartbeats = 0

    def see(self, mode: int, guided_mode: int, seen: Telemetry) -> None:
        """Record the mode of a vehicle that is being sent setpoints."""
        if mode != guided_mode:
            self.mode, self._heartbeats = mode, seen.heartbeats

    def confirm_mode(self, seen: Telemetry, *, waiting: bool) -> None:
        """Forget the mode once heartbeats show the result of commanding it; `waiting`: not acknowledged yet."""
        if self.mode is not None and waiting:
            self._heartbeats = seen.heartbeats
        elif seen.heartbeats >= self._heartbeats + SHOWN_IN_HEARTBEATS:
            self.mode = None
