"""Faults of telemetry: what a vehicle's messages say of one quantity, altered on their way out.

An emulated vehicle alters the messages that it sends, `airlink.proxy` those that pass. Nothing else changes: the
vehicle flies on by what it knows.
"""

from __future__ import annotations

import math
from collections.abc import Callable
from typing import Final, NamedTuple

import numpy as np

from airlink.clock import Instant, seconds_between
from airlink.messages import Message
from airlink.messages.system import Heartbeat
from airlink.messages.telemetry import Attitude, GlobalPositionInt, GpsRawInt, LocalPositionNed, VfrHud
from airlink.telemetry_faults import OF_MESSAGES, VECTORS, Effect, Quantity, Vector

EARTH_M: Final = 6_371_009.0
"""Mean radius (IUGG), m: a displacement is good to 0.6 %."""


class Accessor(NamedTuple):
    """What a kind of message says of a quantity: how to read it, and how to write it into a message of that kind."""

    read: Callable[[Message], Vector]
    write: Callable[[Message, Vector], Message]


def _position(message: Message) -> Vector:
    assert isinstance(message, GlobalPositionInt | GpsRawInt)
    return EARTH_M * message.lat_rad, EARTH_M * math.cos(message.lat_rad) * message.lon_rad, -message.alt_m


def _at_position(message: Message, value: Vector) -> Message:
    assert isinstance(message, GlobalPositionInt | GpsRawInt)
    north_m, east_m, down_m = value
    to_east = EARTH_M * math.cos(message.lat_rad)
    moved = message.but(lat_rad=north_m / EARTH_M, lon_rad=east_m / to_east, alt_m=-down_m)
    if isinstance(moved, GlobalPositionInt):
        return moved.but(relative_alt_m=moved.relative_alt_m - down_m - message.alt_m)
    return moved


def _of(*names: str) -> Accessor:
    """Return how fields are read and written as the components of a vector; those that it lacks are 0."""

    def read(message: Message) -> Vector:
        values = [float(getattr(message, name)) for name in names]
        north, east, down = [*values, 0.0, 0.0][:3]
        return north, east, down

    def write(message: Message, value: Vector) -> Message:
        return message.but(**dict(zip(names, value, strict=False)))

    return Accessor(read, write)


def _heights(message: Message) -> Vector:
    assert isinstance(message, GlobalPositionInt)
    return message.alt_m, message.relative_alt_m, 0.0


def _at_heights(message: Message, value: Vector) -> Message:
    return message.but(alt_m=value[0], relative_alt_m=value[1])


def _above_home(message: Message) -> Vector:
    assert isinstance(message, LocalPositionNed)
    return -message.z_m, 0.0, 0.0


def _at_height_above_home(message: Message, value: Vector) -> Message:
    return message.but(z_m=-value[0])


POSITION: Final = Accessor(_position, _at_position)
ACCESSORS: Final[dict[str, dict[type[Message], Accessor]]] = {
    "position": {GlobalPositionInt: POSITION, GpsRawInt: POSITION, LocalPositionNed: _of("x_m", "y_m", "z_m")},
    "velocity": {
        GlobalPositionInt: _of("vx_mps", "vy_mps", "vz_mps"),
        LocalPositionNed: _of("vx_mps", "vy_mps", "vz_mps"),
    },
    "height": {
        GlobalPositionInt: Accessor(_heights, _at_heights),
        LocalPositionNed: Accessor(_above_home, _at_height_above_home),
        VfrHud: _of("alt_m"),
    },
    "airspeed": {VfrHud: _of("airspeed_mps")},
    "attitude": {Attitude: _of("roll_rad", "pitch_rad", "yaw_rad")},
    "heartbeat": {Heartbeat: _of("base_mode")},
}
"""Which messages have a quantity, and where; a stamp is in all that have one."""
STAMP: Final = _of("time_boot_s")


class TelemetryFault:
    """One fault of one vehicle's telemetry, from the instant at which it began."""

    def __init__(
        self,
        quantity: Quantity,
        effect: Effect,
        amount: float | Vector | None,
        random: np.random.Generator,
        began: Instant,
    ) -> None:
        """Take what `refusal` finds nothing wrong with.

        Args:
            quantity: which the messages report.
            effect: what happens to it.
            amount: in the quantity's unit (m, m/s, rad, s), of `drift` per second, of `late` and `duplicate` in s: a
                number, or north, east and down (attitude: roll, pitch, yaw). A number alone offsets, or drifts, a
                position or velocity northwards, an attitude in yaw.
            random: draws `noise`.
            began: since when.
        """
        self._quantity, self._effect, self._random, self._began = quantity, effect, random, began
        self._amount = _components(quantity, effect, amount)
        self._held = dict[type[Message], Message]()
        """The first message of each kind since it began."""

    def sent(self, message: Message, now: Instant) -> list[tuple[float, Message]]:
        """Return what is sent in place of a message: messages, and by how much later, s; nothing if it is missing."""
        kind = type(message)
        accessor = ACCESSORS.get(self._quantity, {}).get(kind)
        if self._quantity == "stamps" and "time_boot_s" in message.kind().fields:
            accessor = STAMP
        if accessor is None:
            return [(0.0, message)]
        later_s = self._amount[0]
        if self._effect in OF_MESSAGES:
            copies = {"late": [later_s], "duplicate": [0.0, later_s], "missing": list[float]()}[self._effect]
            return [(each_s, message) for each_s in copies]
        held = self._held.setdefault(kind, message)
        if self._quantity == "heartbeat":
            return [(0.0, held)]
        first, value = accessor.read(held), accessor.read(message)
        changed = self._changed(value, first, seconds_between(self._began, now))
        return [(0.0, accessor.write(message, changed))]

    def _changed(self, value: Vector, first: Vector, elapsed_s: float) -> Vector:
        effect, amount = self._effect, self._amount
        # Where a quantity has no zero of its own, it is scaled from where the fault began.
        origin = first if self._quantity in ("position", "stamps") else (0.0, 0.0, 0.0)
        if effect == "offset":
            found = [each + by for each, by in zip(value, amount, strict=True)]
        elif effect == "drift":
            found = [each + by * elapsed_s for each, by in zip(value, amount, strict=True)]
        elif effect == "noise":
            drawn = self._random.standard_normal(3).tolist()
            drawn = [drawn[0]] * 3 if self._quantity == "height" else drawn  # one height, above sea level and home
            found = [each + sigma * by for each, sigma, by in zip(value, amount, drawn, strict=True)]
        elif effect in ("scale", "sign"):
            found = [zero + by * (each - zero) for each, by, zero in zip(value, amount, origin, strict=True)]
        else:
            to = {"freeze": first, "zero": (0.0, 0.0, 0.0), "nan": (math.nan, math.nan, math.nan)}[effect]
            found = [*to[:2], value[2] if self._quantity == "position" else to[2]]
        return found[0], found[1], found[2]


def _components(quantity: str, effect: str, amount: float | Vector | None) -> Vector:
    """Return the amount of each component."""
    if isinstance(amount, tuple):
        return amount
    number = -1.0 if effect == "sign" else amount or 0.0
    if quantity == "position" and effect in ("noise", "scale", "sign"):
        return number, number, 0.0 if effect == "noise" else 1.0
    if effect in ("offset", "drift") and quantity in VECTORS:
        return (0.0, 0.0, number) if quantity == "attitude" else (number, 0.0, 0.0)
    return number, number, number
