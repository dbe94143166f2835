"""Ground truth of simulated vehicles: their own logs, brought onto the run's clock by what the station knew of theirs.

A simulator logs where its vehicle truly is, stamped by the clock by which it stamps telemetry. The station measures
that clock by round trips all through the flight; its offset is noted every second and taken to change linearly between.
An error of it, milliseconds on one machine, is one of a position along its path: 22 m/s for 5 ms are 0.11 m.
"""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from typing import Final

import numpy as np

from airlink.clock import NANOSECONDS, Instant, after
from airlink.endpoint import VehicleId
from flight_model.arrays import Array, wrap
from flight_model.earth import GeodeticOrigin, radii_m
from flight_model.slot import slot_axis
from gcs_formation.app.sitl.simulator import TrueMotion
from gcs_formation.station import Station

SAMPLED_S: Final = 1.0
STEP_S: Final = 0.04
"""Of the rows that are made of all vehicles' logs, s of the run."""
AIRBORNE_M: Final = 1.0
"""Height above its home from which a vehicle counts as in the air, m."""
NOUGHT: Final = ("disturbance_north_mps", "disturbance_east_mps", "disturbance_down_mps")
PLACED: Final = ("north_m", "east_m", "height_m", "north_mps", "east_mps", "climb_mps", "airspeed_mps", "airborne")


class Clocks:
    """Each vehicle's clock against the run's, noted through the flight."""

    def __init__(self, station: Station) -> None:
        """Record those of a station's vehicles."""
        self._station = station
        self._next = Instant(0)
        self.offsets: dict[VehicleId, list[tuple[float, float]]] = {each: [] for each in station.vehicles}
        """The run's time, s, and what the vehicle's clock is ahead of it, s."""

    def record_offsets(self, now: Instant) -> bool:
        """Record the offsets, once a second; return whether that was now."""
        if now < self._next:
            return False
        self._next, at_s = after(now, SAMPLED_S), now / NANOSECONDS
        for identity, vehicle in self._station.vehicles.items():
            if vehicle.round_trips.clock.samples:
                self.offsets[identity].append((at_s, vehicle.round_trips.clock.offset_at_s(at_s)))
        return True


def to_run_s(boot_s: Array, offsets: Sequence[tuple[float, float]]) -> Array:
    """Return times of the run for times since a vehicle's boot, (N,) each, s."""
    at_s, ahead_s = np.array(offsets).T
    return boot_s - np.interp(boot_s, at_s + ahead_s, ahead_s)


class LoggedTruth:
    """The true motion of all vehicles at common times."""

    def __init__(
        self,
        motions: Sequence[TrueMotion],
        offsets: Sequence[Sequence[tuple[float, float]]],
        hovering: Sequence[bool],
        origin: GeodeticOrigin,
    ) -> None:
        """Take each vehicle's motion and clock and whether it can hover, in the scenario's order.

        Before its first sample and after its last one a vehicle is where that says. The heading of one that hovers is
        the axis of the slots behind it, as the law and the emulated vehicles define it: its nose may point elsewhere.
        """
        times = [to_run_s(motion.boot_s, clock) for motion, clock in zip(motions, offsets, strict=True)]
        begin_s, end_s = min(each[0] for each in times), max(each[-1] for each in times)
        self._time_s = np.arange(math.floor(begin_s / STEP_S), math.ceil(end_s / STEP_S) + 1) * STEP_S
        each = [_at(self._time_s, at_s, motion, origin) for at_s, motion in zip(times, motions, strict=True)]
        for one, hovers in zip(each, hovering, strict=True):
            if hovers:
                one["heading_rad"] = _slot_axes(one)
        self._columns = {name: np.stack([one[name] for one in each], axis=1) for name in each[0]}

    def between(self, from_s: float, to_s: float) -> dict[str, Array]:
        """Return the rows from the last at or before `from_s` to the first after `to_s`, two at least."""
        count = self._time_s.size
        first = max(0, min(int(self._time_s.searchsorted(from_s, side="right")) - 1, count - 2))
        end = max(first + 2, int(self._time_s.searchsorted(to_s, side="right")) + 1)
        rows = slice(first, end)
        return {"time_s": self._time_s[rows].copy(), **{name: each[rows] for name, each in self._columns.items()}}


def _at(time_s: Array, known_s: Array, motion: TrueMotion, origin: GeodeticOrigin) -> dict[str, Array]:
    """Return a vehicle's columns at times (T,), as `sim_vehicles.truth` names them."""
    halfway_rad = (motion.lat_rad + origin.lat_rad) / 2.0
    meridian_m, across_m = radii_m(halfway_rad)
    columns = {
        "north_m": (motion.lat_rad - origin.lat_rad) * meridian_m,
        "east_m": wrap(motion.lon_rad - origin.lon_rad) * across_m * np.cos(halfway_rad),
        "height_m": motion.alt_m - origin.alt_m,
        "north_mps": motion.north_mps,
        "east_mps": motion.east_mps,
        "climb_mps": motion.climb_mps,
        "airspeed_mps": motion.airspeed_mps,
        "airborne": (motion.alt_m - motion.alt_m[0] > AIRBORNE_M).astype(np.float64),
    }
    found = {name: np.interp(time_s, known_s, columns[name]) for name in PLACED}
    for name in ("north_mps", "east_mps", "climb_mps"):  # still where it isn't logged
        found[name][(time_s < known_s[0]) | (time_s > known_s[-1])] = 0.0
    found["airborne"] = (found["airborne"] >= 1.0).astype(np.float64)
    found["heading_rad"] = wrap(np.interp(time_s, known_s, np.unwrap(motion.heading_rad)))
    return found | {name: np.zeros_like(time_s) for name in NOUGHT}


def _slot_axes(columns: Mapping[str, Array]) -> Array:
    """Return the axis of slots behind a vehicle that hovers, (T,), by its nose and velocity."""
    rows = zip(columns["heading_rad"], columns["north_mps"], columns["east_mps"], strict=True)
    return np.array([slot_axis(nose_rad, north_mps, east_mps) for nose_rad, north_mps, east_mps in rows])


def lacking(motions: Mapping[VehicleId, TrueMotion | None], clocks: Clocks) -> str:
    """Return in words whose true motion isn't known; "" if everybody's is."""
    unlogged = [str(each) for each, motion in motions.items() if motion is None]
    unclocked = [str(each) for each in motions if not clocks.offsets[each] and str(each) not in unlogged]
    why = [("has no true motion in its log", unlogged), ("has reported no clock", unclocked)]
    return "; ".join(f"vehicle {', '.join(who)} {what}" for what, who in why if who)
