"""Faults of telemetry on a link: what passes from vehicles is altered, frame by frame; the rest passes as it is.

A signed frame passes unaltered: it couldn't be signed again.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Iterator, Sequence
from dataclasses import dataclass
from typing import Final

import numpy as np

from airlink.clock import Instant, after, seconds_between
from airlink.endpoint import AirlinkError
from airlink.frame import HEADER_V2, SIGNED_FLAG, Frame, reframed
from airlink.frame_pieces import Pieces
from airlink.messages import Message
from airlink.messages.payload import MARKER_V2
from airlink.stream_parser import StreamParser
from airlink.telemetry_faults import EFFECTS, QUANTITIES, Effect, Quantity, Vector, refusal
from airlink.telemetry_faults.altering import TelemetryFault

MAX_SYSTEM: Final = 255
KEYS: Final = "quantity, effect, amount, vehicles, at_s, for_s"


class FaultError(AirlinkError):
    """A fault that can't be injected; the message says what was found, and what is allowed."""


@dataclass(frozen=True)
class LinkFault:
    """A fault of some vehicles' telemetry, as among a scenario's `faults`."""

    quantity: Quantity
    effect: Effect
    amount: float | Vector | None = None
    vehicles: frozenset[int] = frozenset()
    """Their system ids; empty: all."""
    at_s: float = 0.0
    """When it begins, s after the first datagram from any vehicle."""
    for_s: float = math.inf

    def acts(self, system: int, elapsed_s: float) -> bool:
        """Return whether it alters what a system sends at a time."""
        return self.at_s <= elapsed_s < self.at_s + self.for_s and (not self.vehicles or system in self.vehicles)


def fault_of(keys: dict[str, object]) -> LinkFault:
    """Return the fault that some keys of a scenario's fault describe.

    Args:
        keys: by name; amounts are numbers or lists of 3, vehicles a list or "all".

    Raises:
        FaultError: a key or its value isn't allowed.
    """
    for name, allowed in (("quantity", QUANTITIES), ("effect", EFFECTS)):
        if keys.get(name) not in allowed:
            raise FaultError(f"{name}: found {keys.get(name, 'none')}; allowed: {', '.join(allowed)}")
    unknown = [name for name in keys if name not in KEYS.split(", ")]
    if unknown:
        raise FaultError(f"found key '{unknown[0]}'; allowed: {KEYS}")
    amount, vehicles = keys.get("amount"), keys.get("vehicles", "all")
    times = {name: _number(name, keys[name], 0.0) for name in ("at_s", "for_s") if name in keys}
    quantity: Quantity = next(each for each in QUANTITIES if each == keys["quantity"])
    effect: Effect = next(each for each in EFFECTS if each == keys["effect"])
    fault = LinkFault(quantity, effect, _amount(amount), _systems(vehicles), **times)
    wrong = refusal(quantity, effect, fault.amount)
    if wrong is not None:
        raise FaultError(f"{wrong[0]}: {wrong[1]}; allowed: {wrong[2]}")
    return fault


def _number(name: str, value: object, minimum: float = -math.inf) -> float:
    if isinstance(value, int | float) and math.isfinite(value) and value >= minimum:
        return float(value)
    raise FaultError(f"{name}: found {value}; allowed: {'numbers' if minimum < 0.0 else 'numbers from 0'}")


def _amount(value: object) -> float | Vector | None:
    if value is None:
        return None
    if isinstance(value, list):
        if len(value) != len(("north", "east", "down")):
            raise FaultError(f"amount: found {value}; allowed: a number, or a list of 3")
        first, second, third = (_number("amount", each) for each in value)
        return first, second, third
    return _number("amount", value)


def _systems(value: object) -> frozenset[int]:
    if value == "all":
        return frozenset()
    listed = value if isinstance(value, list) else [value]
    systems = frozenset(each for each in listed if isinstance(each, int) and 0 < each <= MAX_SYSTEM)
    if listed and len(systems) == len(listed):
        return systems
    raise FaultError(f"vehicles: found {value}; allowed: a list of system ids from 1 to {MAX_SYSTEM}, or all")


class AlteredStream:
    """What one remote sends, altered by the faults that act on it."""

    def __init__(self, draws: Callable[[int], np.random.Generator]) -> None:
        """Start with nothing begun; `draws` gives the random numbers of the fault with a number."""
        self._draws = draws
        self._begun = dict[tuple[int, int], TelemetryFault]()
        """By the number of the fault, and the system."""

    def pass_on(
        self, data: bytes, faults: Sequence[LinkFault], began: Instant, now: Instant
    ) -> Iterator[tuple[float, bytes]]:
        """Yield what is sent in place of a datagram: data, and by how much later, s.

        What passes at once stays together, in its order.
        """
        at_once, later = list[bytes](), list[tuple[float, bytes]]()
        for piece in (*(pieces := Pieces()).cut(data), pieces.rest):
            for by_s, passed in self._piece(piece, faults, began, now):
                if by_s > 0.0:
                    later.append((by_s, passed))
                else:
                    at_once.append(passed)
        if any(at_once):
            yield 0.0, b"".join(at_once)
        yield from later

    def _piece(
        self, piece: bytes, faults: Sequence[LinkFault], began: Instant, now: Instant
    ) -> list[tuple[float, bytes]]:
        frames, elapsed_s = StreamParser().feed(piece), seconds_between(began, now)
        self._forget(faults, elapsed_s)
        if len(frames) != 1 or frames[0].message is None or _is_signed(piece):
            return [(0.0, piece)]
        frame, sent = frames[0], [(0.0, frames[0].message)]
        for number, fault in enumerate(faults):
            if fault.acts(frame.system, elapsed_s):
                altered = self._altered(number, fault, frame, after(began, fault.at_s))
                sent = [(by_s + more_s, each) for by_s, one in sent for more_s, each in altered.sent(one, now)]
        return [(by_s, _framed(frame, each)) for by_s, each in sent]

    def _altered(self, number: int, fault: LinkFault, frame: Frame, began: Instant) -> TelemetryFault:
        begun = self._begun.get((number, frame.system))
        if begun is None:
            begun = TelemetryFault(fault.quantity, fault.effect, fault.amount, self._draws(number), began)
            self._begun[number, frame.system] = begun
        return begun

    def _forget(self, faults: Sequence[LinkFault], elapsed_s: float) -> None:
        for number, system in list(self._begun):
            if number >= len(faults) or not faults[number].acts(system, elapsed_s):
                del self._begun[number, system]


def _is_signed(frame: bytes) -> bool:
    return len(frame) > HEADER_V2 and frame[0] == MARKER_V2 and bool(frame[2] & SIGNED_FLAG)


def _framed(frame: Frame, message: Message) -> bytes:
    return frame.raw if message is frame.message else reframed(frame, message)
