"""Rules for radios that several vehicles share."""

from __future__ import annotations

import math
from collections.abc import Iterator

from airlink.endpoint import VehicleId
from formation_scenario.links import min_mean_burst
from formation_scenario.model import Scenario
from formation_scenario.source import Finding
from formation_scenario.vehicle_rules import one_vehicle


def channels(scenario: Scenario) -> Iterator[Finding]:
    """Yield radios without a rate, with impossible losses, of vehicles that don't exist, or that share a vehicle."""
    for index, channel in enumerate(scenario.links.channels):
        key = ("links", "channels", index)
        if channel.rate_kbps is None and channel.profile is None:
            yield key, "found a channel without a data rate", "rate_kbps or profile"
        min_burst = min_mean_burst(channel.loss or 0.0)
        if channel.mean_burst is not None and channel.mean_burst < min_burst:
            allowed = f"{min_burst:g} or more with that loss" if min_burst < math.inf else "a loss below 1 beside it"
            found = f"found {channel.mean_burst:g} with a loss of {channel.loss:g}"
            yield (*key, "mean_burst"), found, allowed
        if not isinstance(channel.vehicles, str):
            for row, ref in enumerate(channel.vehicles):
                yield from one_vehicle(ref, scenario.vehicles, (*key, "vehicles", row))
    yield from _shared(scenario)


def _shared(scenario: Scenario) -> Iterator[Finding]:
    """Yield a radio's vehicles that another has too."""
    owner = dict[VehicleId, int]()
    for index, vehicles in scenario.channel_members():
        again = [each for each in vehicles if owner.setdefault(each.vehicle_id, index) != index]
        if again:
            names = ", ".join(str(each.vehicle_id) for each in again)
            found = f"found vehicles that another channel has too: {names}"
            yield ("links", "channels", index, "vehicles"), found, "each vehicle in one channel at most"
