"""Reports vehicles that their pilots, or their own failsafes, fly outside the fence: nobody holds these inside."""

from __future__ import annotations

from airlink.clock import Instant
from airlink.endpoint import VehicleId
from formation_scenario import Scenario
from gcs_formation.recorder import Note
from gcs_formation.vehicle.vehicle import Member, Vehicle


class PilotsAndFence:
    """Watches by telemetry the vehicles that have left the formation."""

    def __init__(self, scenario: Scenario, vehicles: dict[VehicleId, Vehicle], note: Note) -> None:
        """Begin with everybody inside; without a fence nothing is reported."""
        self._fence, self._vehicles, self._note = scenario.safety.fence, vehicles, note
        self._outside = set[VehicleId]()

    def watch(self, now: Instant) -> None:
        """Report who is outside in its pilot's hands, and who no longer is."""
        if self._fence is None:
            return
        for identity, vehicle in self._vehicles.items():
            seen = vehicle.telemetry.motion
            away_m = 0.0
            if seen is not None and vehicle.member is Member.PARTED and vehicle.airborne:
                away_m = self._fence.outside_m(seen.north_m, seen.east_m, seen.height_m)
            if away_m > 0.0 and identity not in self._outside:
                self._outside.add(identity)
                text = f"flown outside by its pilot or its failsafe, {away_m:.1f} m"
                self._note(now, "fence", text, vehicle, {"begins": True})
            elif identity in self._outside and not away_m > 0.0:
                self._outside.discard(identity)
                text = "no longer flown outside by its pilot or its failsafe"
                self._note(now, "fence", text, vehicle, {"begins": False})
