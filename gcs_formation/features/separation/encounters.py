# Compiled by mypyc: it runs every tick.

"""Encounters of two vehicles: when one begins and ends to avoid another, as events."""

from __future__ import annotations

import math
from dataclasses import dataclass
from typing import Final

import numpy as np

from airlink.clock import Instant, seconds_between
from flight_model.slot import HEIGHT
from formation_scenario import Scenario
from formation_scenario.slot_assignment import ids_by_index
from gcs_formation.features.separation.conflict_resolution import Conflict
from gcs_formation.features.separation.traffic import TrafficPicture
from gcs_formation.recorder import Detail, Event, Tick

LASTS_S: Final = 30.0
"""An encounter is reported again if it lasts longer."""


@dataclass
class Encounter:
    """A vehicle that avoids another."""

    begun: Instant
    min_m: float = math.inf
    """Least distance since then, from the states that the law uses."""
    lasts: bool = False
    """Whether it has been reported as lasting."""


class Encounters:
    """The encounters that go on."""

    def __init__(self, scenario: Scenario) -> None:
        """Begin with none."""
        self._identities = ids_by_index(scenario)
        self._each: dict[tuple[int, int], Encounter] = {}

    @property
    def any(self) -> bool:
        """Whether any goes on."""
        return bool(self._each)

    def log_events(
        self, tick: Tick, picture: TrafficPicture, conflicts: tuple[Conflict, ...], side: list[float]
    ) -> None:
        """Log who avoids whom at a tick; `side`: up, down or neither, (C,)."""
        if not conflicts and not self._each:
            return
        state, vehicles = picture.traffic.state, picture.vehicles
        where = dict(zip(reversed(vehicles.tolist()), state.position_m[:, ::-1].T, strict=True))
        for conflict in conflicts:
            pair = int(vehicles[conflict.vehicle]), int(vehicles[conflict.other])
            if pair not in self._each:
                self._each[pair] = Encounter(tick.now)
                how = _manoeuvre_text(tick, pair[0], side[pair[0]])
                nearest = f"they would be {conflict.nearest_m:.1f} m apart in {conflict.in_s:.1f} s"
                figures: dict[str, Detail] = {"begins": True, "nearest_m": conflict.nearest_m, "in_s": conflict.in_s}
                self._report(tick, pair, "avoids", f", {how}: {nearest}", figures)
        for pair, encounter in list(self._each.items()):
            if pair[0] in where and pair[1] in where:
                distance_m = float(np.linalg.norm(where[pair[0]] - where[pair[1]]))
                encounter.min_m = min(encounter.min_m, distance_m)
            min_m, lasted_s = encounter.min_m, seconds_between(encounter.begun, tick.now)
            if lasted_s > LASTS_S and not encounter.lasts:
                encounter.lasts = True
                text = f" after {lasted_s:.0f} s: it may not get to where it is commanded"
                self._report(tick, pair, "still avoids", text, {"lasted_s": lasted_s})
            if not side[pair[0]]:
                del self._each[pair]
                figures = {"begins": False, "least_m": min_m, "lasted_s": lasted_s}
                text = f": {lasted_s:.1f} s, {min_m:.1f} m apart at least"
                self._report(tick, pair, "no longer avoids", text, figures)

    def _report(self, tick: Tick, pair: tuple[int, int], what: str, how: str, figures: dict[str, Detail]) -> None:
        """Report that the first of two vehicles begins or ends to avoid the second."""
        vehicle, other = self._identities[pair[0]], str(self._identities[pair[1]])
        details: dict[str, Detail] = {"other": other, **figures}
        tick.events.append(Event(tick.now, "separation", f"{what} {other}{how}", vehicle, details))


def _manoeuvre_text(tick: Tick, index: int, side: float) -> str:
    """Return how a vehicle manoeuvres, for the event."""
    vertically = "upwards" if side > 0.0 else "downwards"
    return vertically if tick.replaced[index][HEIGHT] else "as high"
