"""The time series, one row per vehicle and control tick (docs/timeseries.md), and the ground truth beside it."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from contextlib import suppress
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np
import pyarrow as pa
import pyarrow.parquet as pq
from pyarrow import ipc

from airlink.clock import NANOSECONDS
from airlink.endpoint import VehicleId
from flight_model.arrays import Array, Mask
from gcs_formation.recorder import Tick

CHANNELS = ("speed", "heading", "height")
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
INJECTED = ("injected_up_s", "injected_down_s")
INJECTED_MEAN = "injected_delay_s"
SLOT = ("slot_forward_m", "slot_right_m", "slot_up_m")
LAW_ERROR = ("law_error_x_m", "law_error_y_m", "law_error_z_m")
MIXED = ("mixed_speed_mps", "mixed_heading_rad", "mixed_height_m")
GAINS = tuple(f"{gain}_{channel}" for gain in ("kp", "ki", "kd") for channel in CHANNELS)
TIME = ("t_s", "mission_time_s")
MEASURED = TIME + STATE + SETPOINT + LINK + (AIRBORNE,) + SLOT + LAW_ERROR + MIXED + GAINS
DISTURBANCE = ("true_disturbance_north_mps", "true_disturbance_east_mps", "true_disturbance_down_mps")
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
BATCH_ROWS = 4096
SPOOL_SCHEMA = pa.schema(
    [
        pa.field("network", pa.int32()),
        pa.field("vehicle", pa.int32()),
        pa.field("phase", pa.int8()),
        *(pa.field(name, pa.float64()) for name in MEASURED),
    ]
)


class TickSpool:
    """Appends ticks to a file that can be read up to its last whole batch, also after a crash."""

    def __init__(self, path: Path, columns: Sequence[VehicleId | None]) -> None:
        """Create the file, or the next one beside it where it is there: a stream that was cut off can't be continued.

        `columns` names the vehicle of each of a tick's columns, None for a virtual leader.
        """
        self._flying = [i for i, vehicle in enumerate(columns) if vehicle is not None]
        vehicles = [vehicle for vehicle in columns if vehicle is not None]
        self._network = np.array([vehicle.network for vehicle in vehicles], dtype=np.int32)
        self._system = np.array([vehicle.system for vehicle in vehicles], dtype=np.int32)
        self._tables: list[Array] = []
        self._phases: list[int] = []
        self._writer = ipc.new_stream(str(path.with_name(f"{path.name}{_suffix(len(spools(path)))}")), SPOOL_SCHEMA)

    def add(self, tick: Tick) -> None:
        """Append a tick."""
        self._tables.append(_table(tick)[:, self._flying])
        self._phases.append(PHASES.index(tick.phase))
        if len(self._tables) * len(self._flying) >= BATCH_ROWS:
            self.flush()

    def flush(self) -> None:
        """Write what is waiting."""
        if not self._tables:
            return
        values = np.concatenate(self._tables, axis=1)
        ticks = len(self._tables)
        arrays: list[Any] = [
            pa.array(np.tile(self._network, ticks)),
            pa.array(np.tile(self._system, ticks)),
            pa.array(np.repeat(np.array(self._phases, dtype=np.int8), len(self._flying))),
            *(pa.array(column) for column in values),
        ]
        self._writer.write_batch(pa.record_batch(arrays, schema=SPOOL_SCHEMA))
        self._tables, self._phases = [], []

    def close(self) -> None:
        """Write what is waiting and close the file."""
        self.flush()
        self._writer.close()


def spools(path: Path) -> list[Path]:
    """Return the files of a spool: the first, and one for each time that the run was resumed."""
    found: list[Path] = []
    while (part := path.with_name(f"{path.name}{_suffix(len(found))}")).is_file():
        found.append(part)
    return found


def _suffix(resumed: int) -> str:
    return f".{resumed + 1}" if resumed else ""


def read_spool(path: Path) -> dict[str, Array]:
    """Return the columns of a spool, each of its files up to its last whole batch."""
    batches: list[pa.RecordBatch] = []
    for part in spools(path) or [path]:
        with (
            pa.OSFile(str(part), "rb") as file,
            suppress(pa.ArrowInvalid, OSError),  # cut off in the middle of a batch, or before the first
            ipc.open_stream(file) as reader,
        ):
            batches.extend(reader)
    table = pa.Table.from_batches(batches, schema=SPOOL_SCHEMA)
    return {name: table.column(name).to_numpy() for name in table.column_names}


def in_words(columns: Mapping[str, Array]) -> dict[str, Any]:
    """Return the columns of a spool as the time series has them: phases in words, flags as true or false."""
    named: dict[str, Any] = dict(columns)
    named["phase"] = np.array(PHASES, dtype=object)[columns["phase"].astype(np.intp)]
    named |= {flag: columns[flag] > 0 for flag in ("active", "leads", "yielding", AIRBORNE)}
    return named


def write_parquet(path: Path, columns: Mapping[str, Array]) -> None:
    """Write the time series of a spool's columns."""
    pq.write_table(pa.table(in_words(columns)), path)


def read_parquet(path: Path) -> dict[str, Array]:
    """Return the columns of a time series; phases by their place in `PHASES`."""
    table = pq.read_table(path)
    columns = {name: table.column(name).to_numpy() for name in table.column_names}
    if "phase" in columns:
        numbers = {name: number for number, name in enumerate(PHASES)}
        columns["phase"] = np.array([numbers.get(name, -1) for name in columns["phase"]], dtype=np.float64)
    return columns


def flying(columns: Mapping[str, Array]) -> Mask:
    """Return the rows between the start of the path and the flight's end, those that are scored."""
    return columns["phase"] == PHASES.index("flying")


def _table(tick: Tick) -> Array:
    """Return a tick's values, (`MEASURED`, C)."""
    count = tick.age_s.size
    times = np.full((len(TIME), count), ((tick.now / NANOSECONDS,), (tick.mission_time_s,)))
    leads: Mask = np.arange(count) == tick.leader
    measured = tick.age_s, tick.delay_s, *tick.ways_s.T, tick.jitter_s, tick.margin_used
    link = np.array((*measured, tick.active, leads, tick.yielding, tick.airborne))
    law = tick.slots_m.T, tick.error_m.T, tick.mixed.T, tick.gains.T
    return np.concatenate((times, tick.state.table, tick.setpoints.table, link, *law))


@dataclass(frozen=True)
class GroundTruth:
    """What the emulated vehicles really did: (T,) times in s since the clock's epoch, (T, V) everything else."""

    vehicles: tuple[VehicleId, ...]
    time_s: Array
    north_m: Array
    east_m: Array
    height_m: Array
    north_mps: Array
    east_mps: Array
    climb_mps: Array
    airspeed_mps: Array
    heading_rad: Array
    disturbance_north_mps: Array
    disturbance_east_mps: Array
    disturbance_down_mps: Array
    airborne: Array
    """1 in flight, 0 on the ground."""

    def at(self, vehicle: VehicleId, time_s: Array) -> dict[str, Array]:
        """Return a vehicle's true columns at the given times: places by cubic interpolation, the rest linearly."""
        column = self.vehicles.index(vehicle)
        heading = np.unwrap(self.heading_rad[:, column])
        values = (
            _hermite(self.time_s, self.north_m[:, column], self.north_mps[:, column], time_s),
            _hermite(self.time_s, self.east_m[:, column], self.east_mps[:, column], time_s),
            _hermite(self.time_s, self.height_m[:, column], self.climb_mps[:, column], time_s),
            np.interp(time_s, self.time_s, self.airspeed_mps[:, column]),
            np.interp(time_s, self.time_s, heading),
            *(np.interp(time_s, self.time_s, each[:, column]) for each in self._disturbance()),
        )
        # A place between one in flight and one on the ground is neither.
        airborne = np.interp(time_s, self.time_s, self.airborne[:, column]) >= 1.0
        return {**dict(zip(TRUTH, values, strict=True)), AIRBORNE: airborne.astype(np.float64)}

    def _disturbance(self) -> tuple[Array, Array, Array]:
        return self.disturbance_north_mps, self.disturbance_east_mps, self.disturbance_down_mps


def _hermite(known_s: Array, value: Array, rate: Array, wanted_s: Array) -> Array:
    """Return the cubic through values and rates, constant beyond the ends."""
    index = np.clip(np.searchsorted(known_s, wanted_s, side="right") - 1, 0, len(known_s) - 2)
    step_s = known_s[index + 1] - known_s[index]
    u = np.clip((wanted_s - known_s[index]) / step_s, 0.0, 1.0)
    before, after = value[index], value[index + 1]
    slope_before, slope_after = rate[index] * step_s, rate[index + 1] * step_s
    return (
        before * (1 + 2 * u) * (1 - u) ** 2
        + slope_before * u * (1 - u) ** 2
        + after * u**2 * (3 - 2 * u)
        + slope_after * u**2 * (u - 1)
    )
