"""Two vehicles before the rule in flight: one northwards, and an uncommanded one that crosses its way."""

from __future__ import annotations

import math
from typing import Any

import numpy as np
from librt.vecs import vec
from mypy_extensions import i64

from airlink.clock import Instant, after
from flight_model.slot import UNKNOWN, Vector3
from flight_model.vehicle_arrays import FlightStates
from formation_scenario import load_scenario
from gcs_formation.control.fuzzy_pid import NO_GAINS
from gcs_formation.control.law_interface import LawOutput
from gcs_formation.estimation.projection import MeasuredStates
from gcs_formation.estimation.setpoint_history import SetpointHistory
from gcs_formation.features.separation.resolver import ConflictResolver
from gcs_formation.from_scenario import autopilot_models
from gcs_formation.recorder import Tick, VehicleLink
from tests.flights.conftest import scenario
from tests.gcs_formation import tables

HOVERS: dict[str, Any] = {
    "vehicles": {"count": 2, "model": "arducopter"},
    "formation": {"shape": "follower", "spacing_m": 25},
    "path": {"speed_mps": 8, "waypoints_m": [[0, 0, 50], [900, 0, 50]]},
}


class Crossing:
    """A vehicle northwards, and an uncommanded one that crosses its way westwards at the same height.

    The first is 110 m from the crossing, and reaches it at the same time as a point `behind_m` before the other does.
    """

    def __init__(self, behind_m: float = 6.0, **keys: Any) -> None:
        planned = load_scenario(scenario(**{"vehicles": {"count": 2}, **keys}))
        self.history, self.models = SetpointHistory(planned.law.rate_hz), autopilot_models(planned)
        self.resolver = ConflictResolver(planned, self.history, self.models)
        self.north, self.east = np.array((-110.0, 0.0)), np.array((0.0, 110.0 + behind_m * math.sqrt(2.0)))
        self.speed, self.heading = np.full(2, 22.0), np.array((0.0, -math.pi / 2))
        self.wind_north, self.ours = np.zeros(2), np.array((True, False))
        self.slots_m: list[Vector3] = [(0.0, 0.0, 0.0), (0.0, 30.0, 0.0)]
        self.error_m: list[Vector3] = [UNKNOWN, UNKNOWN]
        self.commanded_mps: float | None = None
        self.commanded_rad: list[float] | None = None
        """By default, setpoints equal to their flight."""
        self.acts_s = 0.0, 0.0
        """How much later than now the present setpoint of each acts."""
        self.circling, self.flew = False, True
        self.height_m, self.holds_at_m = 100.0, math.nan
        """Height of the second vehicle, and the height at which it was commanded to loiter."""
        self.hovers_after_s, self.returns_after_s = math.inf, 0.0
        self.home_m: tuple[float, float] | None = None
        self.flies_home_m: tuple[float, float] | None = None
        """Where the second one's mode takes it."""
        self.received_s: float | None = None
        """Time until which the second is known to have received setpoints; None: now."""
        self.seen_s: float | None = None
        """Time of its last known position; None: now."""

    def keep(self, age_s: float = 0.0, at_s: float = 0.0, planned_m: float | None = None) -> Tick:
        height, none, ours = np.array((100.0, self.height_m)), np.zeros(2), self.ours.tolist()
        table = FlightStates(self.north, self.east, height, none, self.speed, self.heading, self.wind_north, none)
        now = after(Instant(0), at_s)
        links = [VehicleLink(now), VehicleLink(now)]
        links[1].circling, links[1].flew = self.circling, self.flew
        links[1].holds_at_m = self.holds_at_m
        links[1].hovers_after_s, links[1].returns_after_s = self.hovers_after_s, self.returns_after_s
        links[1].home_m, links[1].flies_home_m = self.home_m, self.flies_home_m
        links[1].received_at = now if self.received_s is None else after(Instant(0), self.received_s)
        tick = Tick(now, 0.0, "flying", 0, links, [age_s] * 2, [0.0] * 2, ours)
        tick.state = tables.states(table)
        commanded_mps = [each.airspeed_mps if self.commanded_mps is None else self.commanded_mps for each in tick.state]
        commanded_rad = self.commanded_rad or [each.heading_rad for each in tick.state]
        commands = zip(commanded_mps, commanded_rad, tick.state, strict=True)
        tick.setpoints = [(mps, heading_rad, each.height_m) for mps, heading_rad, each in commands]
        tick.slots_m = self.slots_m
        tick.decided = [
            LawOutput(index, tick.state[index], tick.setpoints[index], error_m, UNKNOWN, NO_GAINS)
            for index, error_m in enumerate(self.error_m)
        ]
        acts = vec[i64]([after(now, each) for each in self.acts_s])
        self.history.begin_tick(acts)
        self.history.record(tick.setpoints)
        planned = None if planned_m is None else np.full((2, 2), planned_m)
        seen: list[int] = [now, now if self.seen_s is None else after(Instant(0), self.seen_s)]
        self.resolver.keep(tick, MeasuredStates(tick.state, vec[i64](seen), ours, acts), planned)
        return tick

    def manoeuvres(self, age_s: float = 0.0, at_s: float = 0.0) -> bool:
        return bool(self.keep(age_s, at_s).yielding[0])
