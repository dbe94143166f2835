# Compiled by mypyc: it runs every tick.

"""Notices that no vehicle is left in the air before the flight is over."""

from __future__ import annotations

from typing import Final

from airlink.clock import Instant, seconds_between
from airlink.endpoint import VehicleId
from gcs_formation.core.cycle import EACH_SECOND, Cycle, Stage
from gcs_formation.phases import OVER
from gcs_formation.vehicle.vehicle import Vehicle

DOWN_S: Final = 4.0
"""How long all vehicles must be down until the flight is given up: a restart looks so for a moment. Tuned: s; 2 to 10;
shown by `pytest tests/gcs_formation/features/all_down`."""


class AllDown(Stage):
    """Watches for vehicles that flew and are on the ground, and ends the flight once all are.

    Silence alone tells nothing: a silent vehicle may fly on. Where its simulator says that it lies on the ground,
    `crashed` of the findings has it.
    """

    name = "all_down"
    when = EACH_SECOND
    after = ("own_parts", "budget", "telemetry_noise", "stream_loss")

    def __init__(self, cycle: Cycle) -> None:
        """Start before the first take-off."""
        self._vehicles, self._findings = cycle.vehicles, cycle.findings
        self._flew = set[VehicleId]()
        self._since: Instant | None = None

    def run(self, cycle: Cycle) -> None:
        """Look at all vehicles, unless the flight is over anyway."""
        if cycle.flight.phase in OVER or cycle.flight.ended:
            return
        all_down = self._watch(cycle.now)
        if all_down is not None:
            cycle.phase_machine.fail(all_down, cycle.now)

    def _watch(self, now: Instant) -> str | None:
        """Return in words that all vehicles are down, once that has lasted for `DOWN_S`; None before."""
        self._flew |= {identity for identity, vehicle in self._vehicles.items() if vehicle.flew}
        up = [vehicle for identity, vehicle in self._vehicles.items() if not self._is_down(identity, vehicle)]
        silent = not any(vehicle.connection.talks for vehicle in up)
        self._findings.silent_aloft = [vehicle.identity for vehicle in up] if silent and self._flew else []
        if not self._flew or any(vehicle.identity not in self._findings.crashed or not silent for vehicle in up):
            self._since = None
            return None
        self._since = now if self._since is None else self._since
        return self._words() if seconds_between(self._since, now) >= DOWN_S else None

    def _is_down(self, identity: VehicleId, vehicle: Vehicle) -> bool:
        """Return whether a vehicle that flew, or was left on the ground, was last received there."""
        return not vehicle.may_fly and (identity in self._flew or vehicle.start_up.abandoned)

    def _words(self) -> str:
        found = dict[str, list[str]]()
        for identity, vehicle in self._vehicles.items():
            found.setdefault(self._how(vehicle), []).append(str(identity))
        each = "; ".join(f"{how}: {', '.join(names)}" for how, names in found.items())
        return f"all vehicles are down before the flight is over ({each})"

    def _how(self, vehicle: Vehicle) -> str:
        if vehicle.identity in self._findings.crashed:
            return "silent on the ground"
        if vehicle.identity not in self._flew:
            return "never took off"
        return "landed" if vehicle.telemetry.armed else "disarmed"
