"""A recorded flight as arrays, with its errors."""

from __future__ import annotations

from collections.abc import Iterator, Mapping
from dataclasses import dataclass

import numpy as np
import numpy.typing as npt

from airlink.endpoint import VehicleId
from flight_model.arrays import Array, Mask
from formation_scenario import Ground, Scenario
from gcs_formation.record.timeseries import (
    AIRBORNE,
    ERROR,
    GROUND,
    INJECTED,
    INJECTED_MEAN,
    LAW_ERROR,
    PHASES,
    ROWS_AT_ONCE,
    TRUTH,
    flying,
    true_columns,
)

Columns = Mapping[str, Array]


@dataclass(frozen=True)
class Flight:
    """The time series, vehicle by vehicle: every vehicle has a row for every tick, so columns are parallel."""

    vehicles: Mapping[VehicleId, Columns]
    truth: bool
    """Whether the errors are from ground truth; from telemetry otherwise."""

    @property
    def mission_time_s(self) -> Array:
        """(T,) seconds since the leader started along its path, NaN before."""
        return next(iter(self.vehicles.values()))["mission_time_s"]

    def window(self, from_s: float, to_s: float) -> Mask:
        """Return a (T,) mask of the ticks in a window of mission time, both ends included, before the flight's end."""
        time_s = self.mission_time_s
        return flying(next(iter(self.vehicles.values()))) & (time_s >= from_s - 1e-9) & (time_s <= to_s + 1e-9)

    def place(self, vehicle: VehicleId) -> Array:
        """Return (T, 3) north, east, height: true ones where there is truth."""
        return _place(self.vehicles[vehicle], truth=self.truth)

    def heading(self, vehicle: VehicleId) -> Array:
        """Return (T,) headings, rad: true ones where there is truth."""
        return self.vehicles[vehicle]["true_heading_rad" if self.truth else "heading_rad"]

    def place_in_flight(self, vehicle: VehicleId) -> Array:
        """Return (T, 3) the same, NaN where the vehicle doesn't fly."""
        return np.where(self.airborne(vehicle)[:, None], self.place(vehicle), np.nan)

    def airborne(self, vehicle: VehicleId) -> Mask:
        """Return (T,) whether a vehicle flies: in truth where there is truth, else as far as the station knew.

        A vehicle on the ground is not part of the formation: separation, clearance and errors leave it out.
        """
        return self.vehicles[vehicle][AIRBORNE] > 0

    def clearance(self, vehicle: VehicleId) -> Array:
        """Return (T,) heights above the ground, at the true place where there is truth.

        NaN on the ground, before a vehicle was first commanded (it takes off), and where it lands at the end.
        """
        own = self.vehicles[vehicle]
        begun = np.maximum.accumulate(own["active"] > 0)
        lands = (own["phase"] == PHASES.index("loitering")) & ~(own[AIRBORNE][-1:] > 0)
        return np.where(self.airborne(vehicle) & begun & ~lands, own[GROUND[1]], np.nan)

    def leader_at(self, tick: int) -> VehicleId | None:
        """Return the vehicle that led at a tick, None where a virtual leader did."""
        return next((vehicle for vehicle, own in self.vehicles.items() if own["leads"][tick] > 0), None)

    def has_followed(self, vehicle: VehicleId) -> bool:
        """Whether a vehicle flew in the formation without leading it."""
        own = self.vehicles[vehicle]
        return bool(((own["active"] > 0) & ~(own["leads"] > 0)).any())

    def followers(self, scenario: Scenario) -> list[VehicleId]:
        """Return the scenario's followers, and its leader where that has followed another."""
        planned = [vehicle.vehicle_id for vehicle in scenario.followers]
        return [vehicle for vehicle in self.vehicles if vehicle in planned or self.has_followed(vehicle)]

    def error(self, vehicle: VehicleId) -> Array:
        """Return (T, 3) signed formation errors of a follower, x, y and z in m."""
        return np.column_stack([self.vehicles[vehicle][name] for name in ERROR])

    def scored(self, vehicle: VehicleId, window: Mask) -> tuple[Array, Array]:
        """Return mission times (N,) and errors (N, 3) of the ticks in a (T,) window at which a follower has errors."""
        time_s, error_m = self.mission_time_s[window], self.error(vehicle)[window]
        seen = np.isfinite(error_m).all(axis=1)
        return time_s[seen], error_m[seen]

    def missed(self, vehicle: VehicleId, window: Mask) -> int:
        """Return at how many ticks at the end of a (T,) window a vehicle neither has errors nor leads: it is lost.

        It is down, or has no leader any more.
        """
        seen = np.isfinite(self.error(vehicle)[window]).all(axis=1) | (self.vehicles[vehicle]["leads"][window] > 0)
        return int(seen[::-1].argmax()) if seen.any() else seen.size

    def leaderless(self, window: Mask) -> Mask:
        """Return at which ticks of a (T,) window the vehicle that leads lies on the ground."""
        down = [(own["leads"] > 0) & ~(own[AIRBORNE] > 0) for own in self.vehicles.values()]
        return np.any(down, axis=0)[window]


def split(columns: Columns, scenario: Scenario, truth: Columns | None, injected_s: Mapping[VehicleId, Array]) -> Flight:
    """Return the flight of a spool's columns, with injected delays, true places, errors and clearances added.

    `truth` is what the emulated vehicles really did, as `sim_vehicles.truth` names and reads it: `time_s` (T,) since
    the clock's epoch, all else (T, V) in the scenario's order.
    """
    vehicles: dict[VehicleId, dict[str, Array]] = {}
    for planned in scenario.vehicles:
        identity = planned.vehicle_id
        rows = _rows_of(identity, columns, len(scenario.vehicles))
        vehicles[identity] = {name: values[rows] for name, values in columns.items()}
        vehicles[identity] |= _injected(injected_s[identity])
    if truth is not None:
        known = enumerate(vehicles.items())
        vehicles = {i: {**own, **true_columns(truth, column, own["t_s"])} for column, (i, own) in known}
    frame = scenario.formation.frame
    seen = _leader(vehicles) if truth is not None and scenario.leader else None
    errors = {identity: {**own, **_errors(seen, own, frame)} for identity, own in vehicles.items()}
    ground = scenario.ground
    above = {i: {**own, **_clearance(ground, _place(own, truth=truth is not None))} for i, own in errors.items()}
    return Flight(above, truth is not None)


def _rows_of(identity: VehicleId, columns: Columns, count: int) -> npt.NDArray[np.intp] | slice:
    """Return a vehicle's rows; every `count`-th, which are no copy, unless a resumed flight has another order."""
    rows = np.flatnonzero((columns["network"] == identity.network) & (columns["vehicle"] == identity.system))
    regular = slice(rows[0], None, count) if rows.size else slice(0)
    return regular if np.array_equal(rows, np.arange(columns["network"].size)[regular]) else rows


def _injected(ways_s: Array) -> dict[str, Array]:
    """Return the columns of what was injected up and down, (T, 2) s, and the mean over the ways that were used."""
    used = np.isfinite(ways_s)
    mean_s = np.where(used, ways_s, 0.0).sum(axis=1) / np.where(used.any(axis=1), used.sum(axis=1), np.nan)
    return dict(zip((*INJECTED, INJECTED_MEAN), (*ways_s.T, mean_s), strict=True))


def tables(flight: Flight) -> Iterator[dict[str, Array]]:
    """Yield the time series as tables of at most `ROWS_AT_ONCE` rows or a tick, at least one.

    Ticks are in order, at each the vehicles in order.
    """
    parts = list(flight.vehicles.values())
    at_once = max(1, ROWS_AT_ONCE // len(parts))
    for begin in range(0, max(1, flight.mission_time_s.size), at_once):
        ticks = slice(begin, begin + at_once)
        yield {name: np.stack([part[name][ticks] for part in parts], axis=1).ravel() for name in parts[0]}


def _place(own: Columns, *, truth: bool) -> Array:
    """Return (T, 3) north, east, height: true ones where there is truth."""
    names = TRUTH[:3] if truth else ("north_m", "east_m", "height_m")
    return np.column_stack([own[name] for name in names])


def _clearance(ground: Ground, place: Array) -> dict[str, Array]:
    """Return the ground's height below, and the height above it, at places (T, 3)."""
    height_m = ground.height(place[:, 0], place[:, 1])
    return dict(zip(GROUND, (height_m, place[:, 2] - height_m), strict=True))


def _leader(vehicles: Mapping[VehicleId, Columns]) -> Columns:
    """Return the true columns of whoever leads at each tick."""
    leads = np.stack([own["leads"] for own in vehicles.values()]) > 0
    columns = {name: np.stack([own[name] for own in vehicles.values()]) for name in (*TRUTH, AIRBORNE)}
    chosen = leads.argmax(axis=0)[None]
    return {name: np.take_along_axis(each, chosen, axis=0)[0] for name, each in columns.items()}


def _errors(leader: Columns | None, own: Columns, frame: str) -> dict[str, Array]:
    """Return x_c - x_rc, y_c - y_rc, z_c - z_rc: from true places, or as the law saw them; NaN on the ground.

    Behind a leader that is on the ground, no follower has an error until another vehicle leads.
    """
    airborne = own[AIRBORNE] > 0
    if leader is None:
        return {name: np.where(airborne, own[seen], np.nan) for name, seen in zip(ERROR, LAW_ERROR, strict=True)}
    heading = (leader if frame == "leader_heading" else own)["true_heading_rad"]
    north, east, up = (leader[name] - own[name] for name in TRUTH[:3])
    cos, sin = np.cos(heading), np.sin(heading)
    # A leader's slot is NaN, and so are its errors.
    errors = (
        north * cos + east * sin + own["slot_forward_m"],
        east * cos - north * sin + own["slot_right_m"],
        up + own["slot_up_m"],
    )
    both_fly = airborne & (leader[AIRBORNE] > 0)
    return {name: np.where(both_fly, error, np.nan) for name, error in zip(ERROR, errors, strict=True)}
