"""The keys by which a user sets an impairment, on the command line or while the proxy runs."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass, replace
from typing import Any

from airlink.errors import ImpairmentError
from airlink.impairment import Direction, Impairment


@dataclass(frozen=True)
class Key:
    """One key: how its value is read and shown, which field it sets, what is allowed."""

    field: str
    read: Callable[[str], Any]
    show: Callable[[Any], str]
    allowed: str
    help: str


def _number(low: float, high: float, units: float) -> Callable[[str], float]:
    """Return a reader of numbers from `low` to `high`, in a unit of which one SI unit has `units`."""

    def read(text: str) -> float:
        value = float(text)
        if not low <= value <= high:
            raise ValueError(text)
        return value / units

    return read


def _shown(units: float) -> Callable[[float], str]:
    return lambda value: f"{value * units:g}"


def _one_of(*names: str) -> Callable[[str], str]:
    def read(text: str) -> str:
        if text not in names:
            raise ValueError(text)
        return text

    return read


def _burst(text: str) -> float | None:
    return None if text == "none" else _number(1.0, 1e6, 1.0)(text)


def _switch(text: str) -> bool:
    return _one_of("on", "off")(text) == "on"


def _shown_switch(value: bool) -> str:
    return "on" if value else "off"


_SHARE = "0 to 1"
_MILLISECONDS = "0 to 600000"
_read_ms = _number(0.0, 600_000.0, 1e3)
_read_share = _number(0.0, 1.0, 1.0)

KEYS = {
    "delay-ms": Key("delay_s", _read_ms, _shown(1e3), _MILLISECONDS, "delay"),
    "jitter-ms": Key("jitter_s", _read_ms, _shown(1e3), _MILLISECONDS, "standard deviation of the delay"),
    "distribution": Key(
        "distribution",
        _one_of("normal", "uniform", "pareto"),
        str,
        "normal, uniform, pareto",
        "of the jitter: normal, uniform or pareto",
    ),
    "loss": Key("loss", _read_share, _shown(1.0), _SHARE, "probability that a datagram is lost"),
    "mean-burst": Key(
        "mean_burst",
        _burst,
        lambda value: "none" if value is None else f"{value:g}",
        "1 to 1000000, none",
        "mean number of datagrams lost in a row, none: each on its own",
    ),
    "duplicate": Key("duplicate", _read_share, _shown(1.0), _SHARE, "probability that a datagram comes twice"),
    "rate-kbps": Key("rate_bps", _number(0.0, 1e6, 1e-3), _shown(1e-3), "0 to 1000000", "data rate; 0: no limit"),
    "queue-ms": Key("queue_s", _read_ms, _shown(1e3), _MILLISECONDS, "longest wait for the data rate"),
    "reorder": Key("reorder", _switch, _shown_switch, "on, off", "whether datagrams may overtake others"),
    "outage": Key("outage", _switch, _shown_switch, "on, off", "whether everything is lost"),
}


def changed(impairment: Impairment, key: str, text: str) -> Impairment:
    """Return `impairment` with one key set.

    Raises:
        ImpairmentError: no such key, or a value that isn't allowed; the message says what is.
    """
    if key not in KEYS:
        raise ImpairmentError(f"found key '{key}'; allowed: {', '.join(KEYS)}")
    try:
        value = KEYS[key].read(text)
    except ValueError:
        raise ImpairmentError(f"{key}: found '{text}'; allowed: {KEYS[key].allowed}") from None
    return replace(impairment, **{KEYS[key].field: value})


def described(impairment: Impairment) -> str:
    """Return all keys and their values on one line."""
    return ", ".join(f"{name} {key.show(getattr(impairment, key.field))}" for name, key in KEYS.items())


def apply_line(impairments: dict[Direction, Impairment], line: str) -> None:
    """Apply a line: `KEY VALUE` for both directions, `uplink KEY VALUE` or `downlink KEY VALUE` for one.

    Raises:
        ImpairmentError: the line isn't of that form, or its key or value isn't allowed; nothing is changed.
    """
    words = line.split()
    named = [direction for direction in Direction if words and words[0] == direction.name.lower()]
    directions, rest = named or list(Direction), words[len(named) :]
    if len(rest) != 2:
        raise ImpairmentError(f"found '{line}'; allowed: [uplink|downlink] KEY VALUE, KEY one of {', '.join(KEYS)}")
    impairments.update({way: changed(impairments[way], *rest) for way in directions})
