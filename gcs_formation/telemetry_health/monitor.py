"""Watches whether each vehicle's telemetry can be true: what is flown instead, who leaves the formation, events."""

from __future__ import annotations

import math
from collections.abc import Mapping
from typing import Final

from airlink.clock import Instant
from airlink.endpoint import VehicleId
from flight_model.autopilot_model import AutopilotModel, FlightState
from gcs_formation.estimation.estimator import Sample, VehicleFilter
from gcs_formation.recorder import Note
from gcs_formation.telemetry_health.consistency import POSITION, VELOCITY, Consistency
from gcs_formation.vehicle.vehicle import Vehicle
from gcs_formation.vehicle.velocity_setpoint import ground_motion

UNKNOWN: Final = math.nan
DISPLACED_MOST_M: Final = 30.0
"""A vehicle that is displaced by more, by what it says, doesn't fly in the formation: which of the two is true matters
too much to guess, m."""
FASTER: Final = 1.5
WIND_MPS: Final = 20.0
RISES_MPS: Final = 10.0
"""An aircraft doesn't move faster than this multiple of its limit and this wind, or rise or sink of the air."""
HORIZONTAL: Final = ("position", "velocity")
VERTICAL: Final = ("height", "velocity")


class VehicleHealth:
    """One vehicle's position and height, each with its rate."""

    def __init__(self, vehicle: Vehicle, model: AutopilotModel) -> None:
        """Start by believing everything; the model has the limits of its speeds."""
        self.vehicle = vehicle
        self.across = Consistency(2, FASTER * model.speed_max_mps + WIND_MPS)
        self.up = Consistency(1, FASTER * model.climb_max_mps + RISES_MPS)
        self._reported: dict[str, str] = {}
        """The quantities that aren't believed, or displaced, and in which words that was said."""

    def examine(self, sample: Sample, known: VehicleFilter, *, leads: bool) -> Sample:
        """Return what is to be flown by: the sample itself, or a copy without what can't be true."""
        noise = known.noise.by_quantity
        witness = [UNKNOWN, UNKNOWN] if self.vehicle.telemetry.stands else _by_air(sample, known.state)
        across = self.across.take(
            int(sample.stamp),
            [sample.north_m, sample.east_m],
            [sample.north_mps, sample.east_mps],
            witness,
            (math.sqrt(noise[0]), math.sqrt(noise[2])),
        )
        self.up.doubts_velocity = self.across.wrong == VELOCITY
        up = self.up.take(
            int(sample.stamp),
            [sample.height_m],
            [sample.climb_mps],
            [UNKNOWN],
            (math.sqrt(noise[1]), math.sqrt(noise[3])),
        )
        return self._corrected(sample, leads=leads) if across or up else sample

    def _corrected(self, sample: Sample, *, leads: bool) -> Sample:
        north, east, up = *self.across.axes, self.up.axes[0]
        airspeed_mps, heading_rad = sample.airspeed_mps, sample.heading_rad
        if self.vehicle.telemetry.stands:
            airspeed_mps, heading_rad = ground_motion(heading_rad, north.flown_mps, east.flown_mps, leads=leads)
        return Sample(
            sample.stamp,
            north.flown_m,
            east.flown_m,
            up.flown_m,
            north.flown_mps,
            east.flown_mps,
            up.flown_mps,
            airspeed_mps,
            heading_rad,
            by_course=sample.by_course,
            airspeed_ratio=sample.airspeed_ratio,
        )

    @property
    def unfit(self) -> str:
        """Return why the vehicle can't fly in the formation; empty if it can."""
        for found, (quantity, _) in ((self.across, HORIZONTAL), (self.up, VERTICAL)):
            if found.wrong == POSITION and found.lasts:
                return f"its {quantity} doesn't move by its velocity"
            if found.displaced_m > DISPLACED_MOST_M:
                return f"its {quantity} has jumped by {found.displaced_m:.0f} m"
        return ""

    def changes(self) -> list[tuple[str, bool, str]]:
        """Return what has changed since the last call: quantity, whether it is healthy, and the evidence in words."""
        found = dict[str, str]()
        for each, names in ((self.across, HORIZONTAL), (self.up, VERTICAL)):
            if each.wrong is not None:
                instead = "carried on by its velocity" if each.wrong == POSITION else f"that of its {names[0]} is flown"
                words = f"its {names[0]} moved {each.evidence_m:.1f} m otherwise than its velocity says"
                found[names[each.wrong]] = f"{words}: {names[each.wrong]} not believed, {instead}"
            elif each.displaced_m > 0.0:
                found[names[0]] = f"its {names[0]} has jumped by {each.displaced_m:.1f} m: taken to be where it was"
        if self.vehicle.telemetry.not_finite:
            found["attitude"] = f"{self.vehicle.telemetry.not_finite}: flown without"
        new = [(quantity, False, text) for quantity, text in found.items() if self._reported.get(quantity) != text]
        new += [(each, True, f"its {each} is believed again") for each in self._reported if each not in found]
        self._reported = found
        return new


class TelemetryHealth:
    """All vehicles of a station."""

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

    def examine(self, column: int, sample: Sample | None, now: Instant, *, leads: bool) -> Sample | None:
        """Return what a column's newest sample says, as far as it can be true; an event tells what can't, and since."""
        if sample is None:
            return None
        health = self._each[column]
        examined = health.examine(sample, self._filters[column], leads=leads)
        if examined is not sample or health.vehicle.unfit:
            health.vehicle.unfit = health.unfit
        for quantity, healthy, text in health.changes():
            self._note(now, "health", text, health.vehicle, {"quantity": quantity, "healthy": healthy})
        return examined

    def forget(self, column: int) -> None:
        """Start anew with a vehicle that has restarted."""
        health = self._each[column]
        health.across.forget()
        health.up.forget()
        health.vehicle.unfit = ""


def _by_air(sample: Sample, known: FlightState | None) -> list[float]:
    """Return the velocity over ground by airspeed, heading and the wind known before; NaN while that isn't known."""
    if known is None or math.isnan(known.wind_north_mps):
        return [UNKNOWN, UNKNOWN]
    speed_mps = sample.airspeed_mps
    return [
        speed_mps * math.cos(sample.heading_rad) + known.wind_north_mps,
        speed_mps * math.sin(sample.heading_rad) + known.wind_east_mps,
    ]
