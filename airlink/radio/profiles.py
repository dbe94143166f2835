"""Radios by name: figures of their documents and firmware; docs/links.md has the sources, and what is assumed.

SiK's are computed from its timing (github.com/ArduPilot/SiK, `Firmware/radio/tdm.c`, `tdm_init`) at the default air
rate of 64 kbit/s: a byte takes 9 ticks of 16 us, 18 with error correction.
"""

from __future__ import annotations

from types import MappingProxyType
from typing import Final

from airlink.impairment import Impairment
from airlink.radio.settings import RadioSettings

TICK_S: Final = 16e-6


def _sik(byte_ticks: int, packet_ticks: int, payload_bytes: int) -> RadioSettings:
    """Return a SiK radio: ends take turns of three full packets, with a silence of two empty ones in between."""
    packet_s = TICK_S * (packet_ticks + payload_bytes * byte_ticks)
    rate_bps = 8.0 * payload_bytes / packet_s
    return RadioSettings(
        rate_bps,
        rate_bps,
        turnaround_s=2.0 * TICK_S * packet_ticks,
        window_s=3.0 * packet_s,
        air=Impairment(delay_s=TICK_S * packet_ticks, loss=0.01, reorder=True),
    )


def _mlrs(uplink_bytes: int, downlink_bytes: int, frame_hz: float) -> RadioSettings:
    """Return an mLRS radio: a frame up and one down in each period, for which a datagram waits half a period."""
    wait = Impairment(
        delay_s=0.5 / frame_hz, jitter_s=0.5 / frame_hz / 3.0**0.5, distribution="uniform", loss=0.01, reorder=True
    )
    return RadioSettings(8.0 * uplink_bytes, 8.0 * downlink_bytes, half_duplex=False, buffer_bytes=2048, air=wait)


def _network(
    uplink_bps: float, downlink_bps: float, delay_s: float, jitter_s: float, loss: float, mean_burst: float
) -> RadioSettings:
    """Return a modem on a network, whose delays have a long tail and which doesn't report."""
    air = Impairment(delay_s, jitter_s, "pareto", loss, mean_burst, reorder=True)
    return RadioSettings(
        uplink_bps,
        downlink_bps,
        half_duplex=False,
        buffer_bytes=65_536,
        arbitration="first_come",
        air=air,
        reports=False,
    )


_SIK: Final = _sik(9, 130, 246)
_SIK_ECC: Final = _sik(18, 202, 114)
PROFILES: Final = MappingProxyType(
    {
        "sik_433": _SIK,
        "sik_915": _SIK,
        "sik_433_ecc": _SIK_ECC,
        "sik_915_ecc": _SIK_ECC,
        "rfd900x": _SIK,
        "mlrs_50hz": _mlrs(3200, 4100, 50.0),
        "mlrs_31hz": _mlrs(2000, 2562, 31.25),
        "mlrs_19hz": _mlrs(1207, 1547, 18.87),
        "elrs": RadioSettings(
            4000.0,
            4000.0,
            half_duplex=False,
            buffer_bytes=2048,
            air=Impairment(delay_s=0.005, loss=0.01, reorder=True),
        ),
        "wifi": RadioSettings(
            1.8e6,
            1.8e6,
            buffer_bytes=65_536,
            arbitration="first_come",
            air=Impairment(0.002, 0.002, "pareto", 0.005, 3.0, reorder=True),
            reports=False,
        ),
        "lte": _network(5e6, 2e6, 0.066, 0.03, 0.005, 3.0),
        "satellite_leo": _network(25e6, 5e6, 0.018, 0.005, 0.01, 5.0),
        "satellite_geo": _network(128e3, 128e3, 0.28, 0.015, 0.005, 3.0),
    }
)
