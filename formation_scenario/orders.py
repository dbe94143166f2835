"""Orders to a formation in flight, as an operator writes them: `shape line`, `speed 24`, `leader 2`; and the answer."""

from __future__ import annotations

import math
from collections.abc import Sequence
from typing import Annotated, Literal, NamedTuple, get_args

from pydantic import BeforeValidator, WithJsonSchema
from pydantic_core import PydanticCustomError

from formation_scenario.fields import MAX_NEAR_M, Allowed, Keys, NonNegative, VehicleRef, did_you_mean, key
from formation_scenario.formation import SHAPE_NAMES, FormationChange

End = Literal["loiter", "rtl", "land"]

ENDS: tuple[End, ...] = get_args(End)
ALLOWED = "shape NAME [SPACING_M], spacing SPACING_M, speed MPS, heading DEG, leader ID, loiter, rtl, land"
EXAMPLES = (*(f"shape {shape}" for shape in SHAPE_NAMES), "spacing 40", "speed 24", "heading 90", "leader 2", *ENDS)
MAX_LETTERS = 100
UNKNOWN_SHAPE = "found shape '"
"""How the answer to an order begins whose shape isn't known."""
FACES_RAD = math.radians(15.0)
"""Largest angle between a hovering formation's heading and its path when it sets out."""
MINIMUM, MAX_MPS = math.ulp(0.0), 1000.0
"""Least number above 0; highest speed."""


class OrderError(ValueError):
    """A text that isn't an order; the message says what was found and what is allowed."""


class Order(NamedTuple):
    """One of: a change of the formation, a new speed, a heading in hover, or the way to end the flight."""

    text: str
    change: FormationChange | None = None
    speed_mps: float | None = None
    heading_rad: float | None = None
    """Heading clockwise from north."""
    end: End | None = None


def parse_order(text: str, also: tuple[str, ...] = (), shapes: Sequence[str] = ()) -> Order:
    """Return the order in `text`; `also` are other words that the caller accepts, `shapes` those of extensions.

    Raises:
        OrderError: the text isn't an order.
    """
    order = read_order(text, also)
    name, known = None if order.change is None else order.change.shape, (*SHAPE_NAMES, *shapes)
    if name is not None and name not in known:
        raise OrderError(f"{UNKNOWN_SHAPE}{name}'; allowed: {', '.join(known)}{did_you_mean(name, known)}")
    return order


def read_order(text: str, also: tuple[str, ...] = ()) -> Order:
    """Return the order in `text`, of any shape: whether there is such a one depends on the run's extensions.

    Raises:
        OrderError: the text isn't an order.
    """
    given = " ".join(text[: MAX_LETTERS + 1].split())
    if len(text) > MAX_LETTERS:
        raise OrderError(f"found '{given} …'; allowed: up to {MAX_LETTERS} letters")
    word, *rest = given.split() or [""]
    if word in ENDS and not rest:
        return Order(given, end=word)
    match word, rest:
        case "shape", [name, *spacing] if len(spacing) <= 1:
            return Order(given, FormationChange(at_s=0.0, shape=name, spacing_m=_spacing(spacing)))
        case "spacing", [_]:
            return Order(given, FormationChange(at_s=0.0, spacing_m=_spacing(rest)))
        case "speed", [number]:
            return Order(given, speed_mps=_speed(number))
        case "heading", [number]:
            degrees = _number(number, -360.0, 360.0, "degrees clockwise from north, -360 to 360")
            return Order(given, heading_rad=math.radians(degrees))
        case "leader", [ref]:
            return Order(given, FormationChange(at_s=0.0, leader=_vehicle(ref)))
        case _:
            words = ("shape", "spacing", "speed", "heading", "leader", *ENDS, *also)
            near = "" if word in words else did_you_mean(word, words)
            raise OrderError(f"found '{given}'; allowed: {', '.join((ALLOWED, *also))}{near}")


def why_not_set_out(facing_rad: float, course_rad: float) -> str | None:
    """Return why a hovering formation with a heading can't set out along a course; None if it can."""
    off_rad = abs(math.remainder(facing_rad - course_rad, math.tau))
    if off_rad <= FACES_RAD:
        return None
    allowed = f"up to {math.degrees(FACES_RAD):.0f}°, by `heading {math.degrees(course_rad) % 360.0:.0f}` first"
    return f"the formation faces {math.degrees(off_rad):.0f}° off its path; allowed: {allowed}"


def not_standing(speed_mps: float) -> str:
    """Return why a formation that flies at a speed doesn't turn on the spot."""
    return f"found a formation that flies at {speed_mps:g} m/s; allowed: after `speed 0`"


def _spacing(given: list[str]) -> float | None:
    return (
        _number(given[0], MINIMUM, MAX_NEAR_M, f"a number of m, more than 0, up to {MAX_NEAR_M:g}") if given else None
    )


def _speed(text: str) -> float:
    """Return a speed; 0, which multirotors can fly, may be written in any way."""
    nought = text.startswith("0") and text.removeprefix("0").removeprefix(".").strip("0") == ""
    return 0.0 if nought else _number(text, MINIMUM, MAX_MPS, f"a number from 0 to {MAX_MPS:g} m/s")


def _number(text: str, low: float, high: float, allowed: str) -> float:
    try:
        value = float(text)
    except ValueError:
        value = math.nan
    if not low <= value <= high:
        raise OrderError(f"found '{text}'; allowed: {allowed}")
    return value


def _vehicle(ref: str) -> VehicleRef:
    parts = ref.split(":")
    if len(parts) > 2 or not all(part.isascii() and part.isdigit() and len(part) <= 4 for part in parts):
        raise OrderError(f"found vehicle '{ref}'; allowed: a vehicle's id, or network:id")
    return int(ref) if len(parts) == 1 else ref


def known_order(value: object) -> object:
    """Return a text that is an order; the validator of keys that hold one."""
    try:
        read_order(value if isinstance(value, str) else "")
    except OrderError as error:
        raise PydanticCustomError("order", "no order") from error
    return value


class PlannedOrder(Keys):
    """An order that is given at a mission time, as by `gcs-formation tell`."""

    at_s: NonNegative = key(..., "when, s", 40)
    order: Annotated[
        str, BeforeValidator(known_order), WithJsonSchema({"type": "string"}), Allowed(ALLOWED, EXAMPLES)
    ] = key(..., "the order", "shape line 40")


class Answer(NamedTuple):
    """Whether an order is accepted, and the answer in words."""

    accepted: bool
    text: str
