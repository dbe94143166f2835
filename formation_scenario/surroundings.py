"""Keys of what surrounds and happens to vehicles: disturbances, terrain, faults."""

from __future__ import annotations

import math
from collections.abc import Iterator
from typing import Annotated, Any, Final, Literal, TypeAlias, get_args

import numpy as np
from pydantic import Field, Tag

from airlink.telemetry_faults import Effect, Quantity
from flight_model.arrays import Array
from flight_model.turbulence import low_altitude_turbulence
from formation_scenario.fields import (
    EXTENSION,
    OF_AN_EXTENSION,
    Allowed,
    AtMost,
    Keys,
    Name,
    NonNegative,
    Number,
    Open,
    OwnKeys,
    Positive,
    Text,
    Timed,
    Vector,
    key,
    one_of,
)

Positives: TypeAlias = Annotated[tuple[Positive, Positive, Positive], Allowed("a list of 3 numbers > 0")]
KIND = "how the velocity varies with time"
HillShape = Literal["gaussian", "cosine"]
FaultKind = Literal["crash", "freeze", "restart", "ignore", "pilot", "telemetry"]
FAULTS: Final[tuple[str, ...]] = get_args(FaultKind)
DISTURBANCES: Final = ("step", "ramp", "sine", "dryden")
PilotsMode = Literal["MANUAL", "FBWA", "CRUISE", "LOITER", "RTL"]
PASSING: tuple[str, ...] = ("freeze", "ignore", "pilot", "telemetry")
"""Kinds of faults that may end."""
DEFAULT_MODE: PilotsMode = "LOITER"
TELEMETRY_KEYS: Final = ("quantity", "effect", "amount")


class Passing(Timed):
    """A disturbance of some vehicles, with an optional end."""

    until_s: Positive | None = key(None, "when it ends, s", 90, derived="never")

    @property
    def end_s(self) -> float:
        """When it ends, s; infinite if it doesn't."""
        return math.inf if self.until_s is None else self.until_s

    def acts(self, mission_s: float) -> bool:
        """Return whether it acts at a mission time."""
        return self.at_s <= mission_s < self.end_s


class StepDisturbance(Passing):
    """A velocity that acts at once."""

    kind: Literal["step"] = key("step", KIND)
    velocity_mps: Vector = key(..., "north, east, down, m/s", [0.6, 0.6, 0])


class RampDisturbance(Passing):
    """A velocity that grows linearly, then stays."""

    kind: Literal["ramp"] = key(..., KIND)
    velocity_mps: Vector = key(..., "north, east, down at the ramp's end, m/s", [2, 0, 0])
    duration_s: Positive = key(..., "time from nothing to the whole velocity, s", 5)


class SineDisturbance(Passing):
    """A sinusoidal velocity."""

    kind: Literal["sine"] = key(..., KIND)
    velocity_mps: Vector = key(..., "amplitude north, east, down, m/s", [0, 0.5, 0])
    period_s: Positive = key(..., "period, s", 8)
    phase_deg: Annotated[Number, Field(ge=-360.0, le=360.0)] = key(0.0, "phase at the beginning, degrees", 90)


class DrydenTurbulence(Passing):
    """Turbulence with Dryden's spectra, MIL-F-8785C: for low altitude from the wind at 6 m, or explicit."""

    kind: Literal["dryden"] = key(..., KIND)
    wind_6m_mps: Positive | None = key(None, "mean wind 6 m (20 ft) above ground, m/s", 7)
    sigma_mps: Positives | None = key(None, "instead of wind_6m_mps: rms forward, right, down, m/s", [1.1, 1.1, 0.7])
    length_m: Positives | None = key(None, "beside sigma_mps: scale lengths forward, right, down, m", [200, 200, 50])

    def scales(self, height_m: Array) -> tuple[Array, Array]:
        """Return rms velocities, m/s, and scale lengths, m, at heights (N,) above ground: (3, N); (3, 1) if given."""
        if self.sigma_mps is not None and self.length_m is not None:
            return np.array(self.sigma_mps)[:, None], np.array(self.length_m)[:, None]
        return low_altitude_turbulence(self.wind_6m_mps or 0.0, height_m)


class OwnDisturbance(Passing):
    """A disturbance that an extension registers by this kind."""

    kind: Annotated[str, Open("a kind that an extension registers")] = key(..., KIND, "thermal")
    parameters: OwnKeys = key(None, OF_AN_EXTENSION, {})


Disturbance = Annotated[
    Annotated[StepDisturbance, Tag("step")]
    | Annotated[RampDisturbance, Tag("ramp")]
    | Annotated[SineDisturbance, Tag("sine")]
    | Annotated[DrydenTurbulence, Tag("dryden")]
    | Annotated[OwnDisturbance, Tag(EXTENSION)],
    one_of("kind", "step", DISTURBANCES),
]
"""Several disturbances add up."""


class Hill(Keys):
    """A hill, or a ridge: `height_m` times a shape of the distance d from its top, or from its crest line.

    gaussian: exp(-d²/(2 radius²)); cosine: cos²(π d/(2 radius)), and 0 from d = radius on. A hollow has a negative
    height.
    """

    name: Name = key("hill", "what messages call it", "ridge")
    shape: HillShape = key("gaussian", "form of its section")
    north_m: Number = key(..., "middle of the hill, north of the origin, m", 1500)
    east_m: Number = key(..., "middle of the hill, east of the origin, m", -200)
    height_m: Number = key(..., "height of the top above the ground around, m; hills add up", 80)
    radius_m: Positive = key(..., "one standard deviation (gaussian), or to the foot (cosine), m", 400)
    length_m: NonNegative = key(0.0, "length of a ridge's level crest line, m", 600)
    bearing_deg: Number = key(0.0, "direction of the crest line from north, degrees", 60)


class Terrain(Keys):
    """The ground, and the clearance that the formation keeps from it."""

    file: Text | None = key(
        None,
        "elevations above sea level: a .hgt tile, or a GeoTIFF (with the extra `terrain`); a path from the "
        "scenario's file",
        "N35E125.hgt",
    )
    base_m: Number = key(0.0, "height of the ground around the hills, above the origin, m", 20)
    hills: AtMost[Hill] = key((), "hills and ridges", [{"north_m": 1500, "east_m": 0, "height_m": 30, "radius_m": 600}])
    clearance_m: NonNegative = key(50.0, "height above ground that every vehicle keeps, m", 60)


class Fault(Timed):
    """A fault of some vehicles. Emulators only.

    - crash: it lies on the ground and is silent.
    - freeze: its autopilot hangs, and it flies on by its last setpoint.
    - restart: its autopilot reboots, with its clock at 0.
    - ignore: it acknowledges commands without carrying them out.
    - pilot: its pilot changes the mode, and changes it back to GUIDED at the end.
    - telemetry: its messages say something else of one quantity, and it flies on by what it knows.
    """

    kind: Annotated[str, Open(", ".join(FAULTS), FAULTS)] = key(
        ..., "the kind of fault: one of these, or one that an extension registers", "freeze"
    )
    until_s: Positive | None = key(None, f"{', '.join(PASSING)}: when it ends, s", 50, derived="never")
    for_s: Positive | None = key(None, "instead of until_s: how long it lasts, s", 30, derived="for good")
    mode: PilotsMode | None = key(None, "pilot: the mode that the pilot chooses", "FBWA", derived=DEFAULT_MODE)
    quantity: Quantity | None = key(None, "telemetry: of which the messages say something else", "position")
    effect: Effect | None = key(None, "telemetry: what happens to the quantity", "freeze")
    amount: Vector | Number | None = key(
        None,
        "telemetry, of offset, drift (a second), noise, scale, late and duplicate (s): in m, m/s or rad; a number, or "
        "[north, east, down] of a position or velocity, [roll, pitch, yaw] of an attitude. A number alone offsets "
        "north, or yaw",
        [0, 0, 20],
    )
    parameters: OwnKeys = key(None, OF_AN_EXTENSION, {})

    @property
    def end_s(self) -> float:
        """When it ends, s; infinite if it doesn't."""
        if self.for_s is not None:
            return self.at_s + self.for_s
        return math.inf if self.until_s is None else self.until_s

    @property
    def own_keys(self) -> dict[str, Any]:
        """The keys of its kind alone."""
        if self.kind == "pilot":
            return {"mode": self.mode or DEFAULT_MODE}
        if self.kind == "telemetry":
            return {name: getattr(self, name) for name in TELEMETRY_KEYS}
        return dict(self.parameters or {})

    def moments(self) -> Iterator[tuple[float, bool]]:
        """Yield the mission times at which it begins and, if it does, ends, s, each with whether it is the end."""
        yield self.at_s, False
        if self.end_s < math.inf:
            yield self.end_s, True
