"""The time series, one row per vehicle and control tick (docs/timeseries.md), and interpolation of ground truth."""

from __future__ import annotations

import json
import math
from collections.abc import Iterator, Mapping, Sequence
from pathlib import Path
from typing import Any

import numpy as np
from librt.strings import BytesWriter, write_f64_le

from airlink.clock import NANOSECONDS
from airlink.endpoint import VehicleId
from flight_model.arrays import Array, Mask, columns_of, mapped, wrap
from flight_model.flight_state import FlightState
from flight_model.slot import CHANNELS, UNKNOWN, Vector3
from gcs_formation.control.fuzzy_pid import NO_GAINS
from gcs_formation.errors import RecordError
from gcs_formation.recorder import Tick

STATE = (
    "north_m",
    "east_m",
    "height_m",
    "climb_mps",
    "airspeed_mps",
    "heading_rad",
    "wind_north_mps",
    "wind_east_mps",
)
SETPOINT = ("setpoint_speed_mps", "setpoint_heading_rad", "setpoint_height_m")
LINK = ("age_s", "delay_s", "up_s", "down_s", "jitter_s", "margin_used", "active", "leads", "yielding")
AIRBORNE = "airborne"
FLAGS = ("active", "leads", "yielding", AIRBORNE)
"""Columns that are booleans in a time series, 1 or 0 in a spool."""
INJECTED = ("injected_up_s", "injected_down_s")
INJECTED_MEAN = "injected_delay_s"
SLOT = ("slot_forward_m", "slot_right_m", "slot_up_m")
LAW_ERROR = ("law_error_x_m", "law_error_y_m", "law_error_z_m")
MIXED = ("mixed_speed_mps", "mixed_heading_rad", "mixed_height_m")
GAINS = tuple(f"{gain}_{channel}" for gain in ("kp", "ki", "kd") for channel in CHANNELS)
TIME = ("t_s", "mission_time_s")
MEASURED = TIME + STATE + SETPOINT + LINK + (AIRBORNE,) + SLOT + LAW_ERROR + MIXED + GAINS
DISTURBANCE = ("true_disturbance_north_mps", "true_disturbance_east_mps", "true_disturbance_down_mps")
POSITION = ("north_m", "east_m", "height_m")
VELOCITY = ("north_mps", "east_mps", "climb_mps")
TRUTH = (
    "true_north_m",
    "true_east_m",
    "true_height_m",
    "true_airspeed_mps",
    "true_heading_rad",
    *DISTURBANCE,
)
ERROR = ("error_x_m", "error_y_m", "error_z_m")
GROUND = ("ground_height_m", "clearance_m")
PHASES = ("assembling", "flying", "ending", "loitering", "connecting")
WAITING_TICKS = 64
"""Largest number of ticks buffered before writing."""
ROWS_AT_ONCE = 2**14
"""Rows read or written at once; this bounds memory with hundreds of vehicles."""
NUMBER_BYTES = 8
SPOOLED = ("phase", *MEASURED)
"""The values of each vehicle at a tick in a spool."""
VIRTUAL_LEADER = ("leader_north_m", "leader_east_m", "leader_height_m", "leader_heading_rad")
"""Further values with a virtual leader, which has no rows of its own."""


class SpoolWriter:
    """Appends ticks to a file that is readable up to its last complete tick, also after a crash.

    A line of JSON names the vehicles and the values. Little-endian 64-bit floats follow, tick by tick: for each vehicle
    one number for each value.
    """

    def __init__(self, path: Path, columns: Sequence[VehicleId | None]) -> None:
        """Create the file or, if it exists, the next one next to it, since each run has its own order of vehicles.

        `columns` names the vehicle of each of a tick's columns, None for a virtual leader.
        """
        self._flying = [i for i, vehicle in enumerate(columns) if vehicle is not None]
        self._waiting, self._count, self._virtual = BytesWriter(), 0, len(self._flying) < len(columns)
        self._file = path.with_name(f"{path.name}{_suffix(len(spools(path)))}").open("wb")
        vehicles = [[each.network, each.system] for each in columns if each is not None]
        values = SPOOLED + VIRTUAL_LEADER if self._virtual else SPOOLED
        self._file.write(json.dumps({"vehicles": vehicles, "values": values}).encode() + b"\n")
        self._file.flush()

    def add(self, tick: Tick) -> None:
        """Append a tick."""
        to, phase = self._waiting, float(PHASES.index(tick.phase))
        for column in self._flying:
            write_f64_le(to, phase)
            _write(to, tick, column)
            if self._virtual:
                _write_leader(to, tick.virtual_leader)
        self._count += 1
        if self._count == WAITING_TICKS:
            self.flush()

    def flush(self) -> None:
        """Write the buffer."""
        if self._count:
            self._file.write(self._waiting.getvalue())
            self._waiting.truncate(0)
            self._count = 0
            self._file.flush()

    def close(self) -> None:
        """Write the buffer and close the file."""
        try:
            self.flush()
        finally:
            self._file.close()


def spools(path: Path) -> list[Path]:
    """Return the files of a spool: the first, and one for each time that the run was resumed."""
    found: list[Path] = []
    while (part := path.with_name(f"{path.name}{_suffix(len(found))}")).is_file():
        found.append(part)
    return found


def _suffix(resumed: int) -> str:
    return f".{resumed + 1}" if resumed else ""


class Spool:
    """Reads a spool's files block by block, each up to its last complete tick."""

    def __init__(self, path: Path) -> None:
        """Read the headers.

        Raises:
            RecordError: another version wrote the files, with other values.
        """
        self._parts = [_Part(each) for each in spools(path) or [path]]
        self.ticks = sum(part.ticks for part in self._parts)
        """Total number of ticks."""

    def blocks(self) -> Iterator[dict[str, Array]]:
        """Yield columns, a row for each vehicle and tick, in blocks of at most `ROWS_AT_ONCE` rows or one tick."""
        for part in [part for part in self._parts if part.ticks] or self._parts[:1]:
            yield from part.blocks()

    def read(self) -> dict[str, Array]:
        """Return the columns of all rows."""
        first, *others = self.blocks()
        if not others:
            return first
        return {name: np.concatenate([each, *(block[name] for block in others)]) for name, each in first.items()}


class _Part:
    """One of a spool's files."""

    def __init__(self, path: Path) -> None:
        self._path = path
        with path.open("rb") as file:
            head = file.readline()
            self._begin = file.tell()
        named: dict[str, Any] = json.loads(head) if head.endswith(b"\n") else {"vehicles": [], "values": SPOOLED}
        self._values = tuple(named.get("values", ()))
        if self._values not in {SPOOLED, SPOOLED + VIRTUAL_LEADER}:
            raise RecordError(f"found other values than this version's in {path}; allowed: a record of this version")
        count = (path.stat().st_size - self._begin) // (NUMBER_BYTES * len(self._values))
        self._vehicles = np.array(named["vehicles"], dtype=np.int32).reshape(-1, 2)
        self.ticks = count // max(1, len(self._vehicles))

    def blocks(self) -> Iterator[dict[str, Array]]:
        """Yield the columns in blocks, at least one."""
        vehicles = len(self._vehicles)
        at_once = max(1, ROWS_AT_ONCE // max(1, vehicles))
        for begin in range(0, max(1, self.ticks), at_once):
            ticks = min(at_once, self.ticks - begin)
            network, system = np.tile(self._vehicles, (ticks, 1)).T
            offset = self._begin + NUMBER_BYTES * len(self._values) * vehicles * begin
            columns = columns_of(mapped(self._path, offset, (ticks * vehicles, len(self._values))))
            yield {"network": network, "vehicle": system} | dict(zip(self._values, columns, strict=True))


def flying(columns: Mapping[str, Array]) -> Mask:
    """Return which rows are between the start of the path and the end of the flight; these are scored."""
    return columns["phase"] == PHASES.index("flying")


def _write(to: BytesWriter, tick: Tick, column: int) -> None:
    """Write a vehicle's values of `MEASURED` at a tick."""
    write_f64_le(to, tick.now / NANOSECONDS)
    write_f64_le(to, tick.mission_time_s)
    state = tick.state[column]
    _write_three(to, (state.north_m, state.east_m, state.height_m))
    _write_three(to, (state.climb_mps, state.airspeed_mps, state.heading_rad))
    write_f64_le(to, state.wind_north_mps)
    write_f64_le(to, state.wind_east_mps)
    _write_three(to, tick.setpoints[column])
    _write_link(to, tick, column)
    _write_three(to, tick.slots_m[column])
    _write_three(to, tick.error_of(column))
    decided = tick.decided[column]
    _write_three(to, UNKNOWN if decided is None else decided.mixed)
    gains = NO_GAINS if decided is None else decided.gains
    _write_three(to, (gains[0], gains[1], gains[2]))
    _write_three(to, (gains[3], gains[4], gains[5]))
    _write_three(to, (gains[6], gains[7], gains[8]))


def _write_leader(to: BytesWriter, leader: FlightState | None) -> None:
    """Write the values of `VIRTUAL_LEADER`, NaN before it has a position."""
    _write_three(to, UNKNOWN if leader is None else (leader.north_m, leader.east_m, leader.height_m))
    write_f64_le(to, math.nan if leader is None else leader.heading_rad)


def _write_link(to: BytesWriter, tick: Tick, column: int) -> None:
    link = tick.links[column]
    write_f64_le(to, tick.age_s[column])
    _write_three(to, (link.delay_s, link.up_s, link.down_s))
    write_f64_le(to, link.jitter_s)
    write_f64_le(to, tick.margin_used[column])
    _write_flag(to, tick.active[column])
    _write_flag(to, column == tick.leader)
    _write_flag(to, tick.yielding[column])
    _write_flag(to, link.airborne)


def _write_flag(to: BytesWriter, flag: bool) -> None:
    write_f64_le(to, 1.0 if flag else 0.0)


def _write_three(to: BytesWriter, values: Vector3) -> None:
    first, second, third = values
    write_f64_le(to, first)
    write_f64_le(to, second)
    write_f64_le(to, third)


def true_columns(truth: Mapping[str, Array], time_s: Array) -> dict[str, Array]:
    """Return the vehicles' true columns (T, V) at times (T,): positions by cubic interpolation, the rest linearly."""
    moments = _Moments(truth["time_s"], time_s, truth["airborne"].shape[1])
    position = (moments.cubic(truth[name], truth[rate]) for name, rate in zip(POSITION, VELOCITY, strict=True))
    rest = (moments.linear(truth[name.removeprefix("true_")], angle=name == "true_heading_rad") for name in TRUTH[3:])
    columns = dict(zip(TRUTH, (*position, *rest), strict=True))
    # Between a sample in flight and one on the ground a vehicle doesn't count as airborne.
    return columns | {AIRBORNE: (moments.linear(truth["airborne"]) >= 1.0).astype(np.float64)}


class _Moments:
    """Interpolation of V vehicles' values from times (K,) to times (T,): constant outside."""

    def __init__(self, known_s: Array, wanted_s: Array, vehicles: int) -> None:
        """Find the intervals and the weights of the cubics."""
        self._before = np.clip(np.searchsorted(known_s, wanted_s, side="right") - 1, 0, len(known_s) - 2)
        begin_s = known_s[self._before]
        step_s, since_s = known_s[self._before + 1] - begin_s, wanted_s - begin_s
        self._beyond = np.flatnonzero(wanted_s >= known_s[-1])
        each = [step_s, np.maximum(since_s, 0.0), np.clip(since_s / step_s, 0.0, 1.0)]
        self._step_s, self._since_s, u = (np.repeat(one, vehicles).reshape(-1, vehicles) for one in each)
        self._weights = ((1 + 2 * u, (1 - u) ** 2), (u, (1 - u) ** 2), (u**2, 3 - 2 * u), (u**2, u - 1))

    def _ends(self, value: Array) -> tuple[Array, Array]:
        """Return the values before and after each time, (T, V)."""
        value = np.ascontiguousarray(value)
        return value.take(self._before, axis=0), value.take(self._before + 1, axis=0)

    def linear(self, value: Array, *, angle: bool = False) -> Array:
        """Return values (T, V) interpolated as by `np.interp`; angles by the smaller difference."""
        before, after = self._ends(value)
        change = after - before
        if angle and (np.abs(change) >= np.pi).any():  # rarely
            change = wrap(change)
        found = change / self._step_s * self._since_s + before
        found[self._beyond] = value[-1]
        return found

    def cubic(self, value: Array, rate: Array) -> Array:
        """Return (T, V) cubic Hermite interpolation of values and rates (K, V)."""
        (before, after), (slope_before, slope_after) = self._ends(value), self._ends(rate)
        ends = before, slope_before * self._step_s, after, slope_after * self._step_s
        first, second, third, fourth = (
            end * one * other for end, (one, other) in zip(ends, self._weights, strict=True)
        )
        return first + second + third + fourth
