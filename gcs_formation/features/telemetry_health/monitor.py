# Compiled by mypyc: it runs every tick.

"""Watches whether the telemetry of all vehicles can be true: what is flown by instead, who leaves, events `health`."""

from __future__ import annotations

import itertools
import math
from collections.abc import Mapping, Sequence

from airlink.clock import Instant
from airlink.endpoint import VehicleId
from flight_model.autopilot_model import AutopilotModel
from flight_model.slot import UNKNOWN, Vector3
from gcs_formation.estimation.sample import Sample
from gcs_formation.estimation.setpoint_history import SetpointHistory
from gcs_formation.estimation.vehicle_filter import VehicleFilter
from gcs_formation.features.telemetry_health.vehicle_health import Commanded, VehicleHealth
from gcs_formation.recorder import LogEvent
from gcs_formation.vehicle.member import Member
from gcs_formation.vehicle.vehicle import Vehicle


class TelemetryHealth:
    """The vehicles of a station."""

    def __init__(
        self,
        vehicles: Mapping[VehicleId, Vehicle],
        filters: list[VehicleFilter],
        models: list[AutopilotModel],
        history: SetpointHistory,
        log_event: LogEvent,
        separation_m: float,
    ) -> None:
        """Watch `vehicles`; by index `filters` have their noise, and the wind at each, `models` their limits.

        `history`: the setpoints sent; `separation_m`: distance over the ground at which two vehicles are safe.
        """
        self._each = {each.index: VehicleHealth(each, models[each.index]) for each in vehicles.values()}
        self._filters, self._history, self._log_event = filters, history, log_event
        self._separation_m = separation_m
        self.slots_m: Sequence[Vector3] = ()
        """The slots commanded last, forward, right and up of the leader, whose own is NaN."""

    def examine(
        self, index: int, sample: Sample | None, commanded_m: float, now: Instant, *, leads: bool
    ) -> Sample | None:
        """Return what a vehicle's newest sample says, as far as it can be true; it is commanded to a height, or NaN.

        A vehicle whose position can't be known well enough is `unfit` for the formation. An event says which quantity
        isn't accepted, by which evidence, and later that it is again.
        """
        health = self._each[index]
        vehicle = health.vehicle
        if sample is not None:
            moves = vehicle.telemetry.hovers and not math.isnan(commanded_m)
            acting = self._history.commanded(sample.stamp, index) if moves else UNKNOWN
            commanded = Commanded(commanded_m, acting, stops=vehicle.member is Member.HOLDING)
            sample = health.examine(sample, self._filters[index], commanded, now, leads=leads)
            if health.height_unknown:
                health.stacked = self._stacked()
            vehicle.unfit = health.unfit
        for quantity, healthy, text in health.changes(now):
            self._log_event(now, "health", text, vehicle, {"quantity": quantity, "healthy": healthy})
        return sample

    def _stacked(self) -> bool:
        """Return whether any two slots are within the safe distance of each other over the ground."""
        known = [slot for slot in self.slots_m if not math.isnan(slot[0])]
        known += [(0.0, 0.0, 0.0)] if len(known) < len(self.slots_m) else []
        pairs = itertools.combinations(known, 2)
        return any(math.hypot(one[0] - other[0], one[1] - other[1]) < self._separation_m for one, other in pairs)

    def forget(self, index: int) -> None:
        """Reset what is known of a vehicle that has restarted."""
        self._each[index].begin()
        self._each[index].vehicle.unfit = ""
