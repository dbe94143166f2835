"""Keys of radios that several vehicles share: one medium for all their datagrams, up and down."""

from __future__ import annotations

from typing import Annotated, Final, Literal, NamedTuple, TypeAlias

from pydantic import Field, WithJsonSchema

from airlink.radio.profiles import PROFILES
from formation_scenario.fields import (
    MAX_NUMBER,
    WHOLE,
    Allowed,
    Flag,
    Fraction,
    Keys,
    OneOf,
    Positive,
    VehicleRef,
    key,
)
from formation_scenario.impairment_types import MIN_KBPS, Burst, Distribution, Milliseconds

MIN_BUFFER_BYTES: Final = 300
"""The longest MAVLink frame has 280 bytes."""
ChannelRate = Annotated[
    Positive,
    Field(ge=MIN_KBPS),
    WithJsonSchema({"type": "number", "minimum": MIN_KBPS, "maximum": MAX_NUMBER}),
    Allowed(f"a number >= {MIN_KBPS:g}"),
]
Bytes = Annotated[
    int,
    Field(strict=True, ge=MIN_BUFFER_BYTES, le=10**9),
    WHOLE,
    Allowed(f"a whole number from {MIN_BUFFER_BYTES} to 10^9"),
]
ChannelVehicles: TypeAlias = Annotated[
    Literal["all", "each"] | Annotated[tuple[VehicleRef, ...], Field(min_length=1)],
    Allowed("all, each, or a list of vehicle ids such as [2, 3]"),
]


class Air(NamedTuple):
    """What the air does to what was sent."""

    delay_ms: float
    jitter_ms: float
    loss: float
    mean_burst: float | None


class Channel(Keys):
    """A radio: what goes to its vehicles and comes from them shares one medium."""

    vehicles: ChannelVehicles = key(
        "all", "who is reached by it: all, a list of ids, or each by one of its own", [2, 3]
    )
    profile: Annotated[str, OneOf(", ".join(PROFILES), tuple(PROFILES))] | None = key(
        None, "a radio by name, from whose figures the other keys differ", "sik_915"
    )
    rate_kbps: ChannelRate | None = key(None, "data rate, kbit/s", 57.6)
    uplink_rate_kbps: ChannelRate | None = key(
        None, "data rate to the vehicles if it is another, kbit/s", 25.6, derived="the profile's, or rate_kbps"
    )
    duplex: Literal["half", "full"] | None = key(
        None,
        "half: one end sends at a time; full: the ground and one of the vehicles do",
        "full",
        derived="the profile's, or half",
    )
    turnaround_ms: Milliseconds | None = key(
        None, "half duplex: silence between sending one way and the other, ms", 5, derived="the profile's, or 0"
    )
    buffer_bytes: Bytes | None = key(
        None,
        "what waits at each end before it is sent, bytes; a datagram that doesn't fit is lost",
        4096,
        derived="the profile's, or 1850, a SiK radio's",
    )
    arbitration: Literal["tdm", "first_come"] | None = key(
        None,
        "who sends next: the ends in turns (tdm), or the end whose datagram came first",
        "first_come",
        derived="the profile's, or tdm",
    )
    window_ms: Annotated[Milliseconds, Field(gt=0.0)] | None = key(
        None, "longest turn of one end, ms", 50, derived="the profile's, or 131, a SiK radio's"
    )
    delay_ms: Milliseconds | None = key(None, "further delay after sending, ms", 20, derived="the profile's, or 0")
    jitter_ms: Milliseconds | None = key(None, "standard deviation of that delay, ms", 5, derived="the profile's, or 0")
    distribution: Distribution | None = key(
        None, "distribution of the jitter", "pareto", derived="the profile's, or normal"
    )
    loss: Fraction | None = key(
        None,
        "probability that a datagram is lost on the air, whose time it has used",
        0.05,
        derived="the profile's, or 0",
    )
    mean_burst: Burst | None = key(
        None, "mean number of datagrams lost in a row; without it each is lost on its own", 3
    )
    radio_status: Flag | None = key(
        None, "whether its ends report by RADIO_STATUS once a second", False, derived="the profile's, or true"
    )

    @property
    def air(self) -> Air:
        """What the air does, by the keys or else by the profile."""
        found = Air(0.0, 0.0, 0.0, None)
        if self.profile is not None:
            air = PROFILES[self.profile].air
            found = Air(1e3 * air.delay_s, 1e3 * air.jitter_s, air.loss, air.mean_burst)
        given = {name: getattr(self, name) for name in Air._fields}
        return found._replace(**{name: value for name, value in given.items() if value is not None})
