"""Faults of telemetry: what they may be of, and what they may do."""

from __future__ import annotations

from typing import Final, Literal, TypeAlias, get_args

Quantity = Literal["position", "velocity", "height", "airspeed", "attitude", "heartbeat", "stamps"]
Effect = Literal["freeze", "offset", "drift", "noise", "scale", "sign", "zero", "nan", "late", "duplicate", "missing"]
Vector: TypeAlias = tuple[float, float, float]

QUANTITIES: Final[tuple[Quantity, ...]] = get_args(Quantity)
EFFECTS: Final[tuple[Effect, ...]] = get_args(Effect)
NEEDS_AMOUNT: Final = ("offset", "drift", "noise", "scale", "late")
OF_MESSAGES: Final = ("late", "duplicate", "missing")
"""Effects on whole messages; the others change values."""
OF_HEARTBEATS: Final = ("freeze", *OF_MESSAGES)
"""Effects on heartbeats, which have no number that could be altered."""
OF_STAMPS: Final = ("freeze", "offset", "drift", "noise", "scale", "sign", "zero")
"""Effects on time stamps, which stand in messages of every kind."""
VECTORS: Final = ("position", "velocity", "attitude")
"""Quantities whose amount may be a vector."""


def refusal(quantity: str, effect: str, amount: float | Vector | None) -> tuple[str, str, str] | None:
    """Return what is wrong with a fault: the key, what was found, what is allowed; None if nothing is."""
    allowed = {"heartbeat": OF_HEARTBEATS, "stamps": OF_STAMPS}.get(quantity, EFFECTS)
    if effect not in allowed:
        return "effect", f"found {effect} of {quantity}", ", ".join(allowed)
    if amount is None and effect in NEEDS_AMOUNT:
        return "amount", f"found none for {effect}", _amounts(quantity, effect)
    if amount is not None and effect not in (*NEEDS_AMOUNT, "duplicate"):
        return "amount", f"found one for {effect}", f"only for {', '.join(NEEDS_AMOUNT)}, duplicate"
    if isinstance(amount, tuple) and (effect in OF_MESSAGES or quantity not in VECTORS):
        return "amount", f"found {list(amount)}", _amounts(quantity, effect)
    minimum = amount if isinstance(amount, float) else min(amount or (0.0,))
    if minimum < 0.0 and effect in (*OF_MESSAGES, "noise"):
        return "amount", f"found {minimum:g}", "numbers from 0"
    return None


def _amounts(quantity: str, effect: str) -> str:
    if effect in OF_MESSAGES:
        return "a number from 0, s"
    return "a number, or a list of 3" if quantity in VECTORS else "a number"
