"""Radios that several vehicles share, from the keys of a scenario."""

from __future__ import annotations

from dataclasses import replace
from typing import Any, Final

from airlink.endpoint import VehicleId
from airlink.engine import Datagram
from airlink.impairment import UNIMPAIRED, Impairment
from airlink.radio.profiles import PROFILES
from airlink.radio.settings import RadioSettings
from airlink.radio.shared_radio import SharedRadio
from formation_scenario import Scenario
from formation_scenario.channels import Channel

MILLI: Final = 1e-3
KILO: Final = 1e3


def radios_of(scenario: Scenario) -> dict[VehicleId, SharedRadio[Datagram]]:
    """Return the radio of each vehicle that is reached by one."""
    found = dict[VehicleId, SharedRadio[Datagram]]()
    for number, (index, vehicles) in enumerate(scenario.channel_members()):
        radio = SharedRadio[Datagram](settings_of(scenario.links.channels[index]), scenario.seed, number)
        found |= {vehicle.vehicle_id: radio for vehicle in vehicles}
    return found


def settings_of(channel: Channel) -> RadioSettings:
    """Return what a channel's keys say, in SI units; keys that aren't given are the profile's, or the defaults."""
    rate_bps = KILO * (channel.rate_kbps or 0.0)
    settings = RadioSettings(rate_bps, rate_bps) if channel.profile is None else PROFILES[channel.profile]
    if channel.rate_kbps is not None:
        settings = replace(settings, uplink_bps=rate_bps, downlink_bps=rate_bps)
    if channel.uplink_rate_kbps is not None:
        settings = replace(settings, uplink_bps=KILO * channel.uplink_rate_kbps)
    given: dict[str, Any] = {
        "half_duplex": None if channel.duplex is None else channel.duplex == "half",
        "turnaround_s": _seconds(channel.turnaround_ms),
        "buffer_bytes": channel.buffer_bytes,
        "arbitration": channel.arbitration,
        "window_s": _seconds(channel.window_ms),
        "reports": channel.radio_status,
    }
    settings = replace(settings, **{name: value for name, value in given.items() if value is not None})
    return replace(settings, air=_air(channel, settings.air))


def _air(channel: Channel, air: Impairment) -> Impairment:
    """Return what the air does to datagrams: their order is kept by each link, not by the radio."""
    given: dict[str, Any] = {
        "delay_s": _seconds(channel.delay_ms),
        "jitter_s": _seconds(channel.jitter_ms),
        "distribution": channel.distribution,
        "loss": channel.loss,
        "mean_burst": channel.mean_burst,
    }
    changed = replace(air, **{name: value for name, value in given.items() if value is not None})
    return UNIMPAIRED if changed == UNIMPAIRED else replace(changed, reorder=True)


def _seconds(milliseconds: float | None) -> float | None:
    return None if milliseconds is None else MILLI * milliseconds
