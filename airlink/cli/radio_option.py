"""`airlink-proxy --radio`: a radio that all vehicles behind the proxy share, with the keys of a scenario's channel."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import replace
from types import MappingProxyType
from typing import Any, Final, NamedTuple

from airlink.endpoint import ImpairmentError
from airlink.impairment import UNIMPAIRED
from airlink.radio.profiles import PROFILES
from airlink.radio.settings import RadioSettings


class RadioKey(NamedTuple):
    """A key: the field of `RadioSettings`, or of its `air`, that it sets, and what is allowed."""

    field: str
    low: float = 0.0
    high: float = -1.0
    units: float = 1.0
    """Number of this unit in one SI unit."""
    words: Mapping[str, Any] = MappingProxyType({})
    of_air: bool = False
    whole: bool = False

    @property
    def allowed(self) -> str:
        """The allowed values, as text."""
        return ", ".join(self.words) or f"{'a whole number, ' if self.whole else ''}{self.low:g} to {self.high:.10g}"

    def read(self, text: str) -> Any:  # noqa: ANN401 - whatever a word stands for
        """Return the field's value of a text; ValueError if it isn't allowed."""
        if self.words:
            if text not in self.words:
                raise ValueError(text)
            return self.words[text]
        value = int(text) if self.whole else float(text)
        if not self.low <= value <= self.high:
            raise ValueError(text)
        return value if self.whole else value / self.units


MAX_MS: Final = 600_000.0
MIN_KBPS: Final = 1e-3
RATE: Final = "rate_kbps"
UPLINK_RATE: Final = "uplink_rate_kbps"
RATE_FIELD: Final = "downlink_bps"
UPLINK_FIELD: Final = "uplink_bps"
KEYS: Final[Mapping[str, RadioKey]] = {
    RATE: RadioKey(RATE_FIELD, MIN_KBPS, 1e6, 1e-3),
    UPLINK_RATE: RadioKey(UPLINK_FIELD, MIN_KBPS, 1e6, 1e-3),
    "duplex": RadioKey("half_duplex", words={"half": True, "full": False}),
    "turnaround_ms": RadioKey("turnaround_s", 0.0, MAX_MS, 1e3),
    "buffer_bytes": RadioKey("buffer_bytes", 300, 1e9, whole=True),
    "arbitration": RadioKey("arbitration", words={"tdm": "tdm", "first_come": "first_come"}),
    "window_ms": RadioKey("window_s", 1e-3, MAX_MS, 1e3),
    "radio_status": RadioKey("reports", words={"true": True, "false": False}),
    "delay_ms": RadioKey("delay_s", 0.0, MAX_MS, 1e3, of_air=True),
    "jitter_ms": RadioKey("jitter_s", 0.0, MAX_MS, 1e3, of_air=True),
    "distribution": RadioKey(
        "distribution", words={name: name for name in ("normal", "uniform", "pareto")}, of_air=True
    ),
    "loss": RadioKey("loss", 0.0, 1.0, of_air=True),
    "mean_burst": RadioKey("mean_burst", 1.0, 1e6, of_air=True),
}


def parse_radio(text: str) -> RadioSettings:
    """Return the radio of a text such as `sik_915,loss=0.05` or `rate_kbps=57.6,duplex=half,turnaround_ms=5`.

    Raises:
        ImpairmentError: no such radio or key, or a value that isn't allowed; the message says what is.
    """
    radio: dict[str, Any] = {}
    air: dict[str, Any] = {}
    words = [word.strip() for word in text.split(",")]
    profile = PROFILES.get(words[0])
    for word in words if profile is None else words[1:]:
        name, _, value = (part.strip() for part in word.partition("="))
        key = KEYS.get(name)
        if key is None:
            raise ImpairmentError(
                f"found '{word}'; allowed: [{'|'.join(PROFILES)}],KEY=VALUE,…, KEY of {', '.join(KEYS)}"
            )
        (air if key.of_air else radio)[key.field] = _read(name, key, value)
    if RATE_FIELD in radio:
        radio.setdefault(UPLINK_FIELD, radio[RATE_FIELD])
    elif profile is None:
        raise ImpairmentError(f"found no {RATE}; allowed: {RATE}=57.6 and the like, or one of {', '.join(PROFILES)}")
    settings = RadioSettings(**radio) if profile is None else replace(profile, **radio)
    impairment = replace(settings.air, **air)
    return replace(settings, air=impairment if impairment == UNIMPAIRED else replace(impairment, reorder=True))


def _read(name: str, key: RadioKey, value: str) -> Any:  # noqa: ANN401 - as `RadioKey.read`
    try:
        return key.read(value)
    except ValueError:
        raise ImpairmentError(f"{name}: found '{value}'; allowed: {key.allowed}") from None


def described(settings: RadioSettings) -> str:
    """Return what a radio is, in a few words."""
    up_kbps, down_kbps = settings.uplink_bps / 1e3, settings.downlink_bps / 1e3
    rate = f"{up_kbps:g} kbit/s" if up_kbps == down_kbps else f"{up_kbps:g} kbit/s up, {down_kbps:g} down"
    return f"radio for all: {rate}, {'half' if settings.half_duplex else 'full'} duplex, {settings.arbitration}"
