# Compiled by mypyc: it runs every tick.

"""Reports vehicles that their pilots, or their own failsafes, fly outside the fence: no one holds these inside."""

from __future__ import annotations

from airlink.endpoint import VehicleId
from gcs_formation.core.cycle import EACH_SECOND, Cycle, Stage
from gcs_formation.vehicle.member import Member


class PilotsOutsideFence(Stage):
    """Watches by telemetry the vehicles that have left the formation. It only reports, so it may come at the end."""

    name = "pilots_outside_fence"
    when = EACH_SECOND
    after = ("strangers",)

    def __init__(self, cycle: Cycle) -> None:
        """Begin with everybody inside; without a fence nothing is reported."""
        self._fence = cycle.scenario.fence
        self._outside = set[VehicleId]()

    def run(self, cycle: Cycle) -> None:
        """Report who is outside in its pilot's hands, and who no longer is."""
        if self._fence is None:
            return
        for identity, vehicle in cycle.vehicles.items():
            seen = vehicle.telemetry.motion
            away_m = 0.0
            if seen is not None and vehicle.member is Member.PARTED and vehicle.airborne:
                away_m = self._fence.outside_m(seen.north_m, seen.east_m, seen.height_m)
            if away_m > 0.0 and identity not in self._outside:
                self._outside.add(identity)
                text = f"flown outside by its pilot or its failsafe, {away_m:.1f} m"
                cycle.log_event(cycle.now, "fence", text, vehicle, {"begins": True})
            elif identity in self._outside and not away_m > 0.0:
                self._outside.discard(identity)
                text = "no longer flown outside by its pilot or its failsafe"
                cycle.log_event(cycle.now, "fence", text, vehicle, {"begins": False})
