"""A recorded run as its figures need it."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np

from airlink.endpoint import VehicleId
from flight_model.arrays import Array
from formation_scenario import Scenario
from formation_scenario.gains import redesigned
from gcs_formation.record.flight import RecordedFlight
from gcs_formation.record.timeseries import flying

Events = tuple[Mapping[str, Any], ...]
WORST_WITHOUT_ERRORS = -1.0


@dataclass(frozen=True)
class RunData:
    """A run as its figures need it. `whole` has every tick, `flown` those from the path's start to its end."""

    scenario: Scenario
    summary: Mapping[str, Any]
    events: Events
    whole: RecordedFlight
    flown: RecordedFlight
    zero_s: float
    """The clock's time at mission time 0; at the first tick if the path was never begun."""
    begun: bool
    """Whether the leader ever started along its path. If not, `flown` is everything."""
    missing: tuple[str, ...] = ()
    """What the record of an unfinished run, or of an earlier version, lacks; in words."""

    @property
    def whole_time_s(self) -> Array:
        """(T,) mission times of all ticks, negative before the path."""
        return self.whole.common["t_s"] - self.zero_s

    @property
    def time_s(self) -> Array:
        """(K,) mission times of the flown ticks."""
        return self.flown.common["t_s"] - self.zero_s

    @property
    def scenario_in_force(self) -> Scenario:
        """The scenario with the gains in force at the end: gains by design are redesigned for slow links."""
        return in_force(self.scenario, self.events)

    @property
    def leader(self) -> VehicleId | None:
        """The vehicle that leads first, None when a virtual leader does."""
        return self.scenario.leader.vehicle_id if self.scenario.leader else None

    @property
    def followers(self) -> tuple[VehicleId, ...]:
        """The followers in the scenario's order; last the leader, if it followed another vehicle for a while."""
        led = (self.leader,) if self.leader is not None and self.flown.has_followed(self.leader) else ()
        return (*(vehicle.vehicle_id for vehicle in self.scenario.followers), *led)

    def worst_first(self) -> list[VehicleId]:
        """Return the followers by decreasing root mean square of their flown errors."""

        def rms(vehicle: VehicleId) -> float:
            known = self.flown.error(vehicle)
            known = known[np.isfinite(known).all(axis=1)]
            return float(np.sqrt(np.mean(known**2))) if known.size else WORST_WITHOUT_ERRORS

        return sorted(self.followers, key=rms, reverse=True)


def run_data(
    scenario: Scenario, summary: Mapping[str, Any], events: Events, whole: RecordedFlight, missing: tuple[str, ...]
) -> RunData:
    """Return a run's data, of which `missing` says what the record lacks."""
    mission_s, clock_s = whole.mission_time_s, whole.common["t_s"]
    known = np.flatnonzero(flying(whole.common) & np.isfinite(mission_s))
    first, end = (int(known[0]), int(known[-1]) + 1) if known.size else (0, mission_s.size)
    flown = {v: {name: values[first:end] for name, values in own.items()} for v, own in whole.vehicles.items()}
    zero_s = float(clock_s[first] - (mission_s[first] if known.size else 0.0))
    return RunData(scenario, summary, events, whole, RecordedFlight(flown), zero_s, bool(known.size), missing)


def in_force(scenario: Scenario, events: Sequence[Mapping[str, Any]]) -> Scenario:
    """Return a scenario with the gains that its flight ended with."""
    delays_s = [event["design_delay_s"] for event in events if event.get("kind") == "design"]
    return redesigned(scenario, delays_s[-1]) if delays_s else scenario
