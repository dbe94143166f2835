"""Keys of the vehicles' navigation: what their telemetry tells of their own state."""

from __future__ import annotations

from typing import Annotated, Literal

from pydantic import Field, Tag

from formation_scenario.fields import Keys, NonNegative, Rate, one_of


class TrueNavigation(Keys):
    """Vehicles know their state exactly."""

    source: Literal["truth"] = Field(default="truth", description="truth | noisy")


class NoisyNavigation(Keys):
    """Telemetry carries errors of the sensors; the vehicle's own loops go by the truth."""

    source: Literal["noisy"] = Field(description="truth | noisy")
    rate_hz: Rate = Field(default=10.0, description="new errors a second, as a GNSS receiver's, Hz")
    position_sigma_m: NonNegative = Field(default=0.3, description="standard deviation north, east and up, m")
    velocity_sigma_mps: NonNegative = Field(default=0.1, description="of ground velocity north, east and up, m/s")
    airspeed_sigma_mps: NonNegative = Field(default=0.2, description="of airspeed, m/s")
    heading_sigma_deg: NonNegative = Field(default=0.5, description="of heading, degrees")
    correlation_s: NonNegative = Field(
        default=0.0, description="time constant of first-order Gauss-Markov errors, s; 0: white"
    )


Navigation = Annotated[
    Annotated[TrueNavigation, Tag("truth")] | Annotated[NoisyNavigation, Tag("noisy")],
    one_of("source", default="truth"),
]
