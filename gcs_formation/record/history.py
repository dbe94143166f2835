"""What the recorded events of a flight tell about when its vehicles were whose, and how fast it was to fly."""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field
from typing import Any

from formation_scenario.orders import read_order
from gcs_formation.fleet.membership import PARTED

ACCEPTED = ": accepted"
"""End of the text of an order's event."""
Interval = tuple[float, float]
"""From one time on the run's clock to another, s; infinite for the flight's end."""


@dataclass(frozen=True)
class History:
    """Taken from events in order of time."""

    pilots_s: Mapping[str, Sequence[Interval]] = field(default_factory=dict[str, Sequence[Interval]])
    """When each vehicle was flown by its pilot or its own failsafe, by its name."""
    speeds_mps: Sequence[tuple[float, float]] = ()
    """Times on the run's clock, s, at which another speed was ordered, and this speed."""


def history(events: Sequence[Mapping[str, Any]]) -> History:
    """Return what the events say."""
    begun, found, speeds = dict[str, float](), dict[str, list[Interval]](), list[tuple[float, float]]()
    for event in events:
        kind, text, at_s = str(event["kind"]), str(event["text"]), float(event["t_s"])
        if kind == "member":
            vehicle = str(event["vehicle"])
            if text.startswith(PARTED):
                begun.setdefault(vehicle, at_s)
            elif vehicle in begun:
                found.setdefault(vehicle, []).append((begun.pop(vehicle), at_s))
        elif kind == "order" and event.get("accepted"):
            speed_mps = read_order(text.removesuffix(ACCEPTED)).speed_mps
            speeds += [] if speed_mps is None else [(at_s, speed_mps)]
    for vehicle, since_s in begun.items():
        found.setdefault(vehicle, []).append((since_s, math.inf))
    return History(found, speeds)
