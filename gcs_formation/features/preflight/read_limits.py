"""Limits that vehicles tell by their parameters: they bound what is commanded, or prevent the take-off."""

from __future__ import annotations

from collections.abc import Callable, Sequence

from airlink.endpoint import VehicleId
from formation_scenario import Scenario
from formation_scenario import Vehicle as PlannedVehicle
from formation_scenario.feasibility import check
from formation_scenario.source import dotted
from gcs_formation.vehicle.vehicle import Vehicle

MINIMUM, MAXIMUM, ACCELERATION, TURN_RATE = "speed_min_mps", "speed_max_mps", "accel_max_mps2", "turn_rate_max_rps"
CLIMB = "climb_max_mps"
SHOWN = 3
"""Of what can't be flown so many are named."""
Bound = Callable[[int, float, float, float], None]
"""Bounds a vehicle's acceleration, m/s², its turn rate, rad/s, and its climb and descent, m/s."""


class ReadLimits:
    """The limits of all vehicles that are narrower than their models'."""

    def __init__(self, scenario: Scenario, bound: Bound) -> None:
        """Start with none; `bound` applies those of a vehicle's model."""
        self._scenario, self._bound = scenario, bound
        self._models = {each.vehicle_id: each.model for each in scenario.vehicles}
        self._reported = dict[VehicleId, str]()
        self._unflyable: list[str] | None = None
        self._news = False

    def take_news(self) -> tuple[PlannedVehicle, ...] | None:
        """Return the scenario's vehicles with these limits if there are new ones; None if there are none."""
        news, self._news = self._news, False
        return self._vehicles() if news else None

    def apply(self, vehicle: Vehicle, bounds: Sequence[tuple[str, float, str]]) -> None:
        """Bound a vehicle's setpoints by the keys of its model, the bounds, and the parameters that say so."""
        if not bounds:
            return
        autopilot, model = vehicle.autopilot, self._models[vehicle.identity]
        own = dict[str, float]()
        for key, value, _ in bounds:  # climb and descent bound one key
            own[key] = max(own.get(key, value), value) if key == MINIMUM else min(own.get(key, value), value)
        reported = autopilot.commanded_airspeed(model.speed_min_mps), autopilot.commanded_airspeed(model.speed_max_mps)
        slowest_mps, fastest_mps = (
            max(own.get(MINIMUM, reported[0]), reported[0]),
            min(own.get(MAXIMUM, reported[1]), reported[1]),
        )
        if not slowest_mps < fastest_mps:
            return  # no speed is left; the check of the parameter refuses it
        autopilot.bound_speeds(slowest_mps, fastest_mps)
        accel_mps2 = min(own.get(ACCELERATION, model.accel_max_mps2), model.accel_max_mps2)
        turn_rps = min(own.get(TURN_RATE, model.turn_rate_max_rps), model.turn_rate_max_rps)
        autopilot.turn_rate_max_rps = turn_rps
        climb_mps = min(own.get(CLIMB, model.climb_max_mps), model.climb_max_mps)
        self._bound(vehicle.index, accel_mps2, turn_rps, climb_mps)
        update = {ACCELERATION: accel_mps2, TURN_RATE: turn_rps, CLIMB: climb_mps}
        update |= {MINIMUM: autopilot.true_airspeed(slowest_mps), MAXIMUM: autopilot.true_airspeed(fastest_mps)}
        self._models[vehicle.identity] = model.model_copy(update=update)
        self._reported[vehicle.identity] = ", ".join(words for _, _, words in bounds)
        self._unflyable, self._news = None, True

    def unflyable(self) -> list[str]:
        """Return in words what of the path and the formation can't be flown within these limits, with its keys."""
        if self._unflyable is None:
            self._unflyable = self._found() if self._reported else []
        return self._unflyable

    def _vehicles(self) -> tuple[PlannedVehicle, ...]:
        models = self._models
        return tuple(each.model_copy(update={"model": models[each.vehicle_id]}) for each in self._scenario.vehicles)

    def _found(self) -> list[str]:
        violations = check(self._scenario.model_copy(update={"vehicles": self._vehicles()}))
        if not violations:
            return []
        whose = "; ".join(f"vehicle {identity}: {words}" for identity, words in self._reported.items())
        each = [f"{dotted(one.key)}: {one.found}; allowed: {one.allowed}" for one in violations[:SHOWN]]
        more = f"; and {len(violations) - SHOWN} more" if len(violations) > SHOWN else ""
        return [f"what vehicles tell ({whose}) isn't enough for {'; '.join(each)}{more}"]
