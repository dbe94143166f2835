"""Keys of what surrounds and happens to vehicles: disturbances, terrain, faults."""

from __future__ import annotations

import math
from typing import Annotated, Literal, TypeAlias

from pydantic import Field, Tag

from formation_scenario.fields import (
    Allowed,
    Keys,
    Name,
    NonNegative,
    Number,
    Positive,
    Text,
    Timed,
    Vector,
    derived,
    one_of,
)

Positives: TypeAlias = Annotated[tuple[Positive, Positive, Positive], Allowed("a list of 3 numbers > 0")]


KIND = "how the velocity goes with time"
HillShape = Literal["gaussian", "cosine"]
FaultKind = Literal["crash", "freeze", "restart", "ignore", "pilot"]
PilotsMode = Literal["MANUAL", "FBWA", "CRUISE", "LOITER", "RTL"]
PASSING: tuple[FaultKind, ...] = ("freeze", "ignore", "pilot")
"""Kinds that may end."""
DEFAULT_MODE: PilotsMode = "LOITER"


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


class Hill(Keys):
    """A hill, or a ridge: `height_m` times a shape of the distance d from its top, or from its crest line.

    gaussian: exp(-d²/(2 radius²)); cosine: cos²(π d/(2 radius)), and 0 from d = radius on. A hollow has a negative
    height.
    """

    name: Name = Field(default="hill", description="what messages call it", examples=["ridge"])
    shape: HillShape = Field(default="gaussian", description="form of its section")
    north_m: Number = Field(description="middle of the hill, north of the origin, m", examples=[1500])
    east_m: Number = Field(description="middle of the hill, east of the origin, m", examples=[-200])
    height_m: Number = Field(description="height of the top above the ground around, m; hills add up", examples=[80])
    radius_m: Positive = Field(
        description="one standard deviation (gaussian), or to the foot (cosine), m", examples=[400]
    )
    length_m: NonNegative = Field(default=0.0, description="length of a ridge's level crest line, m", examples=[600])
    bearing_deg: Number = Field(
        default=0.0, description="direction of the crest line from north, degrees", examples=[60]
    )


class Terrain(Keys):
    """The ground, and the clearance that the formation keeps from it."""

    file: Text | None = Field(
        default=None,
        description="elevations above sea level: a .hgt tile, or a GeoTIFF (with the extra `terrain`); a path from the "
        "scenario's file",
        examples=["N35E125.hgt"],
    )
    base_m: Number = Field(
        default=0.0, description="height of the ground around the hills, above the origin, m", examples=[20]
    )
    hills: tuple[Hill, ...] = Field(
        default=(),
        description="hills and ridges",
        examples=[[{"north_m": 1500, "east_m": 0, "height_m": 30, "radius_m": 600}]],
    )
    clearance_m: NonNegative = Field(
        default=50.0, description="height above ground that every vehicle keeps, m", examples=[60]
    )


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
