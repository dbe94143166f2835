"""Watches whether the telemetry of all vehicles can be true: what is flown by instead, who leaves, events `health`."""

from __future__ import annotations

from collections.abc import Mapping

from airlink.clock import Instant
from airlink.endpoint import VehicleId
from flight_model.autopilot_model import AutopilotModel
from gcs_formation.estimation.estimator import Sample, VehicleFilter
from gcs_formation.recorder import Note
from gcs_formation.telemetry_health.vehicle_health import VehicleHealth
from gcs_formation.vehicle.vehicle import Vehicle


class TelemetryHealth:
    """The vehicles of a station."""

    def __init__(
        self,
        vehicles: Mapping[VehicleId, Vehicle],
        filters: list[VehicleFilter],
        models: list[AutopilotModel],
        note: Note,
    ) -> None:
        """Watch `vehicles`; `filters` have their noise, and the wind at each, `models` their limits, by column."""
        self._each = {each.column: VehicleHealth(each, models[each.column]) for each in vehicles.values()}
        self._filters, self._note = filters, note

    def examine(
        self, column: int, sample: Sample | None, commanded_m: float, now: Instant, *, leads: bool
    ) -> Sample | None:
        """Return what a column's newest sample says, as far as it can be true; it is commanded to a height or NaN.

        A vehicle whose position can't be known well enough is `unfit` for the formation. An event says which quantity
        isn't believed, by which evidence, and later that it is again.
        """
        health = self._each[column]
        vehicle = health.vehicle
        if sample is not None:
            sample = health.examine(sample, self._filters[column], commanded_m, now, leads=leads)
            vehicle.unfit = health.unfit
        for quantity, healthy, text in health.changes(now):
            self._note(now, "health", text, vehicle, {"quantity": quantity, "healthy": healthy})
        return sample

    def forget(self, column: int) -> None:
        """Reset what is known of a vehicle that has restarted."""
        self._each[column].begin()
        self._each[column].vehicle.unfit = ""
