"""Notices that no vehicle is left in the air before the flight is over."""

from __future__ import annotations

from collections.abc import Collection, Mapping
from typing import Final

from airlink.clock import Instant, seconds_between
from airlink.endpoint import VehicleId
from gcs_formation.vehicle.vehicle import Vehicle

DOWN_S: Final = 4.0
"""How long all vehicles must be down until the flight is given up: a restart looks so for a moment."""


class DownWatch:
    """Watches for vehicles that flew and are on the ground.

    Silence alone tells nothing: a silent vehicle may fly on. Where its simulator says that it lies on the ground,
    `lie` takes that.
    """

    def __init__(self, vehicles: Mapping[VehicleId, Vehicle]) -> None:
        """Start before the first take-off."""
        self._vehicles = vehicles
        self._flew, self._wrecks = set[VehicleId](), frozenset[VehicleId]()
        self._since: Instant | None = None
        self.unknown = list[VehicleId]()
        """Silent vehicles that were last heard in the air, if all others are down."""

    def lie(self, wrecks: Collection[VehicleId]) -> None:
        """Take which of the silent vehicles lie on the ground."""
        self._wrecks = frozenset(wrecks)

    def watch(self, now: Instant) -> str | None:
        """Return in words that all vehicles are down, once that has lasted for `DOWN_S`; None before."""
        self._flew |= {identity for identity, vehicle in self._vehicles.items() if vehicle.flew}
        up = [vehicle for identity, vehicle in self._vehicles.items() if not self._is_down(identity, vehicle)]
        silent = not any(vehicle.connection.talks for vehicle in up)
        self.unknown = [vehicle.identity for vehicle in up] if silent and self._flew else []
        if not self._flew or any(vehicle.identity not in self._wrecks or not silent for vehicle in up):
            self._since = None
            return None
        self._since = now if self._since is None else self._since
        return self._words() if seconds_between(self._since, now) >= DOWN_S else None

    def _is_down(self, identity: VehicleId, vehicle: Vehicle) -> bool:
        """Return whether a vehicle that flew, or was left on the ground, was last heard there."""
        return not vehicle.may_fly and (identity in self._flew or vehicle.start_up.abandoned)

    def _words(self) -> str:
        found = dict[str, list[str]]()
        for identity, vehicle in self._vehicles.items():
            found.setdefault(self._how(vehicle), []).append(str(identity))
        each = "; ".join(f"{how}: {', '.join(names)}" for how, names in found.items())
        return f"all vehicles are down before the flight is over ({each})"

    def _how(self, vehicle: Vehicle) -> str:
        if vehicle.identity in self._wrecks:
            return "silent on the ground"
        if vehicle.identity not in self._flew:
            return "never took off"
        return "landed" if vehicle.telemetry.armed else "disarmed"
