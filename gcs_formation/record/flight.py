"""A recorded flight as arrays, with its errors."""

from __future__ import annotations

import math
from collections.abc import Iterable, Iterator, Mapping, Sequence
from dataclasses import dataclass, replace
from typing import Any

import numpy as np

from airlink.endpoint import VehicleId
from flight_model.arrays import Array, Indices, Mask
from formation_scenario import Scenario
from formation_scenario.fields import Frame
from formation_scenario.slot_frame import axis_rad
from gcs_formation.record.coverage import scored_end_s
from gcs_formation.record.history import history
from gcs_formation.record.limits_by_truth import LimitSeries, Truth, limit_series
from gcs_formation.record.path_distance import Distances, path_distances
from gcs_formation.record.timeseries import (
    AIRBORNE,
    ERROR,
    GROUND,
    INJECTED,
    INJECTED_MEAN,
    LAW_ERROR,
    PHASES,
    POSITION,
    SETPOINT,
    SLOT,
    TRUTH,
    VIRTUAL_LEADER,
    flying,
    true_columns,
)

Columns = Mapping[str, Array]
WHOLE = slice(None)
SCORED = frozenset(
    (
        *("t_s", "mission_time_s", "phase", "active", "leads", "yielding", "jitter_s"),
        *(AIRBORNE, *POSITION, *TRUTH[:3], *SETPOINT, *ERROR, GROUND[1]),
        *("heading_rad", "true_heading_rad", *SLOT, *VIRTUAL_LEADER),
    )
)
"""The columns that a summary needs."""


@dataclass(frozen=True)
class RecordedFlight:
    """The time series by vehicle; each has a row for every tick, so that their columns are parallel."""

    vehicles: Mapping[VehicleId, Columns]
    limits: LimitSeries | None = None
    """How near it came to the limits of `safety`; None if that wasn't found out."""
    off_path: Mapping[str, Distances] | None = None
    """How far `leader` and `centre` were from the path at each tick; None if that wasn't found out."""

    @property
    def truth(self) -> bool:
        """Whether there is ground truth, from which errors then are, instead of telemetry."""
        return TRUTH[0] in self.common

    @property
    def common(self) -> Columns:
        """The first vehicle's columns; `t_s`, `mission_time_s` and `phase` are the same for all."""
        return next(iter(self.vehicles.values()))

    @property
    def mission_time_s(self) -> Array:
        """(T,) seconds since the leader started along its path, NaN before."""
        return self.common["mission_time_s"]

    @property
    def ended_s(self) -> float:
        """Mission time of the last row; NaN if the path hadn't begun by then, or nothing is on record."""
        return float(self.mission_time_s[-1]) if self.mission_time_s.size else math.nan

    def window(self, from_s: float, to_s: float) -> Mask:
        """Return a (T,) mask of the ticks in a window of mission time, ends included, before the end of the flight."""
        time_s = self.mission_time_s
        return flying(self.common) & (time_s >= from_s - 1e-9) & (time_s <= to_s + 1e-9)

    def scored_end_s(self, duration_s: float, period_s: float) -> float:
        """Return to which mission time the flight was flown, as `coverage.scored_end_s`."""
        return scored_end_s(self.mission_time_s[flying(self.common)], duration_s, period_s)

    def down_from_s(self, from_s: float, to_s: float) -> float | None:
        """Return the mission time from which no vehicle flies until a window's end; None if one flies at the end."""
        window = self.window(from_s, to_s)
        aloft = np.any([self.airborne(vehicle)[window] for vehicle in self.vehicles], axis=0)
        if not aloft.size or aloft[-1]:
            return None
        return float(self.mission_time_s[window][aloft.size - int(aloft[::-1].argmax()) if aloft.any() else 0])

    def position(self, vehicle: VehicleId) -> Array:
        """Return (T, 3) north, east, height: true ones if there is ground truth."""
        return np.stack([self.vehicles[vehicle][name] for name in (TRUTH if self.truth else POSITION)[:3]]).T

    def heading(self, vehicle: VehicleId) -> Array:
        """Return (T,) headings, rad: true ones if there is ground truth."""
        return self.vehicles[vehicle]["true_heading_rad" if self.truth else "heading_rad"]

    def position_in_flight(self, vehicle: VehicleId) -> Array:
        """Return (T, 3) the same, NaN while the vehicle doesn't fly."""
        return np.where(self.airborne(vehicle), self.position(vehicle).T, np.nan).T

    def airborne(self, vehicle: VehicleId) -> Mask:
        """Return (T,) whether a vehicle flies: by ground truth if there is any, else as known to the station.

        A vehicle on the ground is not part of the formation: separation, clearance and errors leave it out.
        """
        return self.vehicles[vehicle][AIRBORNE] > 0

    def clearance(self, vehicle: VehicleId) -> Array:
        """Return (T,) heights above the ground, at true positions if there is ground truth.

        NaN on the ground, before a vehicle's first setpoint (take-off), and in its landing at the end.
        """
        own = self.vehicles[vehicle]
        begun = np.maximum.accumulate(own["active"] > 0)
        lands = (own["phase"] == PHASES.index("loitering")) & ~(own[AIRBORNE][-1:] > 0)
        return np.where(self.airborne(vehicle) & begun & ~lands, own[GROUND[1]], np.nan)

    def leader_at(self, tick: int) -> VehicleId | None:
        """Return the vehicle that led at a tick, None for a virtual leader."""
        return next((vehicle for vehicle, own in self.vehicles.items() if own["leads"][tick] > 0), None)

    def has_followed(self, vehicle: VehicleId) -> bool:
        """Return whether a vehicle flew in the formation without leading it."""
        own = self.vehicles[vehicle]
        return bool(((own["active"] > 0) & ~(own["leads"] > 0)).any())

    def followers(self, scenario: Scenario) -> list[VehicleId]:
        """Return the scenario's followers, and its leader if that has followed another."""
        planned = [vehicle.vehicle_id for vehicle in scenario.followers]
        return [vehicle for vehicle in self.vehicles if vehicle in planned or self.has_followed(vehicle)]

    def error(self, vehicle: VehicleId, ticks: Mask | slice = WHOLE) -> Array:
        """Return (T, 3) signed formation errors of a follower, x, y and z in m, at all or some ticks."""
        return np.stack([self.vehicles[vehicle][name][ticks] for name in ERROR]).T

    def scored(self, vehicle: VehicleId, window: Mask) -> tuple[Array, Array]:
        """Return mission times (N,) and errors (N, 3) of the ticks in a (T,) window at which a follower has errors."""
        seen = window & self.known(vehicle)
        return self.mission_time_s[seen], self.error(vehicle, seen)

    def missed(self, vehicle: VehicleId, window: Mask) -> int:
        """Return the number of ticks at the end of a (T,) window from which on a vehicle is lost."""
        flies = self._takes_part(vehicle)[window]
        return int(flies[::-1].argmax()) if flies.any() else flies.size

    def is_back(self, vehicle: VehicleId, window: Mask) -> bool:
        """Return whether a vehicle isn't lost any more at the first scored tick after a window; True without one."""
        last = int(np.flatnonzero(window)[-1])
        later = np.flatnonzero(flying(self.common)[last + 1 :])[:1] + last + 1
        return bool(self._takes_part(vehicle)[later].all())

    def ends_with(self, window: Mask) -> bool:
        """Return whether there is no scored tick after a window that has one."""
        return not flying(self.common)[int(np.flatnonzero(window)[-1]) + 1 :].any()

    def leads(self, vehicle: VehicleId) -> Mask:
        """Return (T,) at which ticks a vehicle leads."""
        return self.vehicles[vehicle]["leads"] > 0

    def absent(self, vehicle: VehicleId, window: Mask) -> int:
        """Return the number of ticks of a (T,) window at which a vehicle is lost, whether or not it comes back."""
        return int((window & ~self._takes_part(vehicle)).sum())

    def _takes_part(self, vehicle: VehicleId) -> Mask:
        """Return (T,) whether a vehicle has errors or leads; otherwise it is lost: down, or without a leader."""
        return self.known(vehicle) | (self.vehicles[vehicle]["leads"] > 0)

    def known(self, vehicle: VehicleId) -> Mask:
        """Return (T,) at which ticks a vehicle has errors: it follows another, and both fly."""
        x_m, y_m, z_m = (np.isfinite(self.vehicles[vehicle][name]) for name in ERROR)
        return x_m & y_m & z_m

    def leaderless(self, window: Mask) -> Mask:
        """Return at which ticks of a (T,) window the leader is on the ground."""
        down = [(own["leads"] > 0) & ~(own[AIRBORNE] > 0) for own in self.vehicles.values()]
        return np.any(down, axis=0)[window]


def tables(
    blocks: Iterable[Columns], scenario: Scenario, truth: Truth | None, injected_s: Mapping[VehicleId, Array]
) -> Iterator[dict[str, Array]]:
    """Yield a spool's blocks with injected delays, true positions, errors and clearances added, each column (T, V).

    `truth` reads the emulators' ground truth, as named in `sim_vehicles.truth`: `time_s` (T,) since the clock's epoch,
    all else (T, V) in the scenario's order. `injected_s` has (T, 2) of all blocks' ticks.
    """
    done, delays_s = 0, np.stack([injected_s[each.vehicle_id] for each in scenario.vehicles], axis=1)
    for block in blocks:
        columns = _in_order(block, scenario)
        time_s = columns["t_s"][:, 0]
        columns |= _injected(delays_s[done : done + time_s.size])
        done += time_s.size
        if truth is not None:
            ends_s = (float(time_s[0]), float(time_s[-1])) if time_s.size else (np.inf, np.inf)
            columns |= true_columns(truth(*ends_s), time_s)
        led = scenario.leader is not None or VIRTUAL_LEADER[0] in columns
        columns |= _errors(columns, scenario.formation.frame, seen=truth is not None and led)
        north_m, east_m, height_m = (columns[name] for name in (TRUTH if truth is not None else POSITION)[:3])
        ground_m = np.zeros(north_m.shape)
        for column in range(len(scenario.vehicles) if scenario.terrain else 0):
            ground_m[:, column] = scenario.ground.height(north_m[:, column], east_m[:, column])
        yield columns | dict(zip(GROUND, (ground_m, height_m - ground_m), strict=True))


def judged(
    flight: RecordedFlight,
    scenario: Scenario,
    truth: Truth | None = None,
    events: Sequence[Mapping[str, Any]] = (),
    ended_s: float | None = None,
) -> RecordedFlight:
    """Return the flight with its distances from limits and path.

    Args:
        flight: with the columns of `SCORED`.
        scenario: that was flown.
        truth: as for `tables`.
        events: the flight's, as recorded.
        ended_s: when it ended on the run's clock, s; by default at its last tick.
    """
    past, t_s = history(events), flight.common["t_s"]
    ended_s = (float(t_s[-1]) if t_s.size else 0.0) if ended_s is None else ended_s
    limits = limit_series(scenario, flight.vehicles, truth, past.pilots_s, ended_s)
    return replace(flight, limits=limits, off_path=path_distances(scenario, flight.vehicles, past.speeds_mps))


def split(columns: Columns, scenario: Scenario) -> RecordedFlight:
    """Return the flight recorded in columns (T, V)."""
    identities = enumerate(each.vehicle_id for each in scenario.vehicles)
    vehicles = {identity: {name: each[:, column] for name, each in columns.items()} for column, identity in identities}
    return RecordedFlight(vehicles)


def down_at_end(flight: RecordedFlight) -> str | None:
    """Return in words that every vehicle was on the ground when its flight along the path ended; None if one flew."""
    down_s = flight.down_from_s(0.0, math.inf)
    return None if down_s is None else f"all vehicles were down before the flight was over: from {down_s:.1f} s on"


class FlightBuilder:
    """Collects a flight from columns of `tables` as they pass, so that the others needn't be in memory together."""

    def __init__(self, scenario: Scenario) -> None:
        """Collect the columns in `SCORED`."""
        self._scenario = scenario
        self._taken = dict[str, list[Array]]()

    def passing(self, tables: Iterable[Columns]) -> Iterator[Columns]:
        """Yield the tables (T, V), in order of time; the flight is complete after the last."""
        for each in tables:
            for name, column in each.items():
                if name in SCORED:
                    self._taken.setdefault(name, []).append(np.ascontiguousarray(column.T))
            yield each

    def flight(self) -> RecordedFlight:
        """Return the collected flight, with each vehicle's columns contiguous in memory."""
        columns = {name: np.concatenate(parts, axis=1).T for name, parts in self._taken.items()}
        return split(columns, self._scenario)


def _in_order(columns: Columns, scenario: Scenario) -> dict[str, Array]:
    """Return the columns as (T, V), without copies unless a resumed flight has another order than the scenario's."""
    named = np.array([(each.vehicle_id.network, each.vehicle_id.system) for each in scenario.vehicles])
    each = {name: values.reshape(-1, len(named)) for name, values in columns.items()}
    if (each["network"] == named[:, 0]).all() and (each["vehicle"] == named[:, 1]).all():
        return each
    network, vehicle = columns["network"], columns["vehicle"]
    rows = np.stack([np.flatnonzero((network == one) & (vehicle == other)) for one, other in named.tolist()], axis=1)
    return {name: values[rows] for name, values in columns.items()}


def _injected(delays_s: Array) -> dict[str, Array]:
    """Return the columns of delays injected up and down, (T, V, 2) s, and their mean over the links in use."""
    up_s, down_s = np.ascontiguousarray(delays_s[..., 0]), np.ascontiguousarray(delays_s[..., 1])
    up, down = np.isfinite(up_s), np.isfinite(down_s)
    total_s = np.where(up, up_s, 0.0) + np.where(down, down_s, 0.0)
    mean_s = total_s / np.where(up | down, up.astype(np.float64) + down, np.nan)
    return dict(zip((*INJECTED, INJECTED_MEAN), (up_s, down_s, mean_s), strict=True))


def _errors(columns: Columns, frame: Frame, *, seen: bool) -> dict[str, Array]:
    """Return the errors x_c - x_rc, y_c - y_rc and z_c - z_rc, (T, V), NaN for a leader and on the ground.

    Those behind a leader that is on the ground are NaN too, until another leads.

    Args:
        columns: the time series, (T, V).
        frame: of the slots.
        seen: whether errors are computed from true positions, and from the station's for a virtual leader; else they
            are those that the law computed.
    """
    airborne = columns[AIRBORNE] > 0
    if not seen:
        return {name: np.where(airborne, columns[law], np.nan) for name, law in zip(ERROR, LAW_ERROR, strict=True)}
    ticks, vehicles = columns["t_s"].shape
    leading: Indices = (columns["leads"] > 0).argmax(axis=1)
    begins = np.arange(0, ticks * vehicles, vehicles, dtype=np.intp)
    leads = np.repeat(begins + leading, vehicles)
    needed = (*TRUTH[:3], "true_heading_rad")
    if VIRTUAL_LEADER[0] in columns:
        leader = {name: columns[own] for name, own in zip(needed, VIRTUAL_LEADER, strict=True)}
        leader[AIRBORNE] = np.ones((ticks, vehicles))
    else:
        leader = {name: columns[name].take(leads).reshape(-1, vehicles) for name in (*needed, AIRBORNE)}
    heading = axis_rad(frame, leader["true_heading_rad"], columns["true_heading_rad"])
    north, east, up = (leader[name] - columns[name] for name in TRUTH[:3])
    cos, sin = np.cos(heading), np.sin(heading)
    # A leader's slot is NaN, and so are its errors.
    errors = (
        north * cos + east * sin + columns["slot_forward_m"],
        east * cos - north * sin + columns["slot_right_m"],
        up + columns["slot_up_m"],
    )
    both_fly = airborne & (leader[AIRBORNE] > 0)
    return {name: np.where(both_fly, error, np.nan) for name, error in zip(ERROR, errors, strict=True)}
