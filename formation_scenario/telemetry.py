"""Keys of what vehicles send."""

from __future__ import annotations

from typing import Annotated

from pydantic import Field

from formation_scenario.fields import (
    OF_AN_EXTENSION,
    Flag,
    Keys,
    Number,
    Open,
    OwnKeys,
    key,
)
from formation_scenario.vehicles import CLOCKS


class Telemetry(Keys):
    """What the vehicles send."""

    rate_hz: Annotated[Number, Field(ge=0.5, le=50.0)] = key(
        10.0, "position and attitude messages a second, Hz; at most the rate of an autopilot's main loop", 5
    )
    clock: Annotated[str, Open(", ".join(CLOCKS), CLOCKS)] = key(
        CLOCKS[0],
        "how stamps are mapped to one clock: by half of each link's round trip, by the vehicles' UTC (SYSTEM_TIME), "
        "which is independent of the links, or by an extension's estimator of delay and its asymmetry",
        "gnss",
    )
    parameters: OwnKeys = key(None, f"beside clock: {OF_AN_EXTENSION}", {})
    station_utc: Flag | None = key(
        None,
        "with `clock: gnss`: whether the ground station's own clock keeps UTC to a few ms, as by a GNSS "
        "receiver; delays up and down are then known without a common error",
        True,
        derived="true with the emulated vehicles of `run`, which have the same clock, else false",
    )

    @property
    def by_utc(self) -> bool:
        """Whether stamps are mapped by the vehicles' UTC."""
        return self.clock == "gnss"
