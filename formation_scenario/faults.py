"""Keys of the faults."""

from __future__ import annotations

from typing import Literal

from pydantic import Field

from formation_scenario.fields import Positive, Timed

FaultKind = Literal["crash", "freeze", "restart", "ignore", "pilot"]
PilotsMode = Literal["MANUAL", "FBWA", "CRUISE", "LOITER", "RTL"]
PASSING: tuple[FaultKind, ...] = ("freeze", "ignore", "pilot")
"""Kinds that may end."""
DEFAULT_MODE: PilotsMode = "LOITER"


class Fault(Timed):
    """A fault of some vehicles. Emulators only.

    crash: it lies on the ground and is silent. freeze: its autopilot hangs, and it flies on by its last setpoint.
    restart: its autopilot reboots, with its clock at 0. ignore: it acknowledges commands without carrying them out.
    pilot: its pilot changes the mode, and changes it back to GUIDED at the end.
    """

    kind: FaultKind = Field(description="crash | freeze | restart | ignore | pilot")
    until_s: Positive | None = Field(default=None, description="freeze, ignore, pilot: when it ends, s; default: never")
    mode: PilotsMode | None = Field(default=None, description=f"pilot: the mode; default {DEFAULT_MODE}")
