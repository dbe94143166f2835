"""Keys of the disturbances: velocities that the air adds to vehicles besides the wind."""

from __future__ import annotations

import math
from typing import Annotated, Literal, TypeAlias

from pydantic import Field, Tag

from formation_scenario.fields import Allowed, Number, Positive, Timed, Vector, derived, one_of

Positives: TypeAlias = Annotated[tuple[Positive, Positive, Positive], Allowed("a list of 3 numbers > 0")]


KIND = "how the velocity goes with time"


class Passing(Timed):
    """A disturbance of some vehicles, with an optional end."""

    until_s: Positive | None = Field(
        default=None, description="when it ends, s", json_schema_extra=derived("never"), examples=[90]
    )

    @property
    def end_s(self) -> float:
        """Its end, s; infinite if it has none."""
        return math.inf if self.until_s is None else self.until_s


class StepDisturbance(Passing):
    """A velocity that acts at once."""

    kind: Literal["step"] = Field(default="step", description=KIND)
    velocity_mps: Vector = Field(description="north, east, down, m/s", examples=[[0.6, 0.6, 0]])


class RampDisturbance(Passing):
    """A velocity that grows linearly, then stays."""

    kind: Literal["ramp"] = Field(description=KIND)
    velocity_mps: Vector = Field(description="north, east, down at the ramp's end, m/s", examples=[[2, 0, 0]])
    duration_s: Positive = Field(description="time from nothing to the whole velocity, s", examples=[5])


class SineDisturbance(Passing):
    """A sinusoidal velocity."""

    kind: Literal["sine"] = Field(description=KIND)
    velocity_mps: Vector = Field(description="amplitude north, east, down, m/s", examples=[[0, 0.5, 0]])
    period_s: Positive = Field(description="period, s", examples=[8])
    phase_deg: Annotated[Number, Field(ge=-360.0, le=360.0)] = Field(
        default=0.0, description="phase at the beginning, degrees", examples=[90]
    )


class DrydenTurbulence(Passing):
    """Turbulence with Dryden's spectra, MIL-F-8785C: for low altitude from the wind at 6 m, or explicit."""

    kind: Literal["dryden"] = Field(description=KIND)
    wind_6m_mps: Positive | None = Field(
        default=None, description="mean wind 6 m (20 ft) above ground, m/s", examples=[7]
    )
    sigma_mps: Positives | None = Field(
        default=None, description="instead of wind_6m_mps: rms forward, right, down, m/s", examples=[[1.1, 1.1, 0.7]]
    )
    length_m: Positives | None = Field(
        default=None, description="beside sigma_mps: scale lengths forward, right, down, m", examples=[[200, 200, 50]]
    )


Disturbance = Annotated[
    Annotated[StepDisturbance, Tag("step")]
    | Annotated[RampDisturbance, Tag("ramp")]
    | Annotated[SineDisturbance, Tag("sine")]
    | Annotated[DrydenTurbulence, Tag("dryden")],
    one_of("kind", default="step"),
]
"""Entries add up."""
