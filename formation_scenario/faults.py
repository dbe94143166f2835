"""Keys of the faults."""

from __future__ import annotations

from typing import Literal

from pydantic import Field

from formation_scenario.fields import Positive, Timed, derived

FaultKind = Literal["crash", "freeze", "restart", "ignore", "pilot"]
PilotsMode = Literal["MANUAL", "FBWA", "CRUISE", "LOITER", "RTL"]
PASSING: tuple[FaultKind, ...] = ("freeze", "ignore", "pilot")
"""Kinds that may end."""
DEFAULT_MODE: PilotsMode = "LOITER"


class Fault(Timed):
    """A fault of some vehicles. Emulators only.

    - crash: it lies on the ground and is silent.
    - freeze: its autopilot hangs, and it flies on by its last setpoint.
    - restart: its autopilot reboots, with its clock at 0.
    - ignore: it acknowledges commands without carrying them out.
    - pilot: its pilot changes the mode, and changes it back to GUIDED at the end.
    """

    kind: FaultKind = Field(description="the kind of fault", examples=["freeze"])
    until_s: Positive | None = Field(
        default=None,
        description="freeze, ignore, pilot: when it ends, s",
        json_schema_extra=derived("never"),
        examples=[50],
    )
    mode: PilotsMode | None = Field(
        default=None,
        description="pilot: the mode that the pilot chooses",
        json_schema_extra=derived(DEFAULT_MODE),
        examples=["FBWA"],
    )
