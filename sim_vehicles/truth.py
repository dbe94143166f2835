"""Ground truth of a fleet: a file of rows of float64 that can be read while it is being written."""

from __future__ import annotations

import struct
from contextlib import suppress
from pathlib import Path
from types import TracebackType
from typing import TYPE_CHECKING, Final, Self

import numpy as np
from librt.strings import BytesWriter, write_f64_le

from airlink.clock import NANOSECONDS, Instant
from flight_model.arrays import BLOCK_BYTES, Array, columns_of
from sim_vehicles.autopilot.board_clock import LOOP_HZ

if TYPE_CHECKING:
    from sim_vehicles.fleet import Fleet

MAGIC = b"truth\x00\x00\x03"
TURNS: Final = 2
"""Cycles of the main loop for each row."""
HEADER = struct.Struct("<8sQ")
QUANTITIES = (
    "north_m",
    "east_m",
    "height_m",
    "north_mps",
    "east_mps",
    "climb_mps",
    "airspeed_mps",
    "heading_rad",
    "disturbance_north_mps",
    "disturbance_east_mps",
    "disturbance_down_mps",
    "airborne",
)
"""Of each vehicle: NED from the origin, height and climb upwards; the sum of all disturbances without the wind; 1 in
flight, 0 on the ground."""


class TruthError(Exception):
    """A file that isn't a record of ground truth."""


class TruthWriter:
    """Appends rows to the file; pass it to a fleet as its truth listener."""

    def __init__(self, path: Path, vehicles: int) -> None:
        """Create the file."""
        self._file = path.open("wb")
        self._file.write(HEADER.pack(MAGIC, vehicles))
        self._turn, self._full = 0, False
        self._waiting = BytesWriter()

    def __enter__(self) -> Self:
        """Return the writer."""
        return self

    def __exit__(
        self, kind: type[BaseException] | None, error: BaseException | None, trace: TracebackType | None
    ) -> None:
        """Write what is waiting and close the file."""
        self._write()
        with suppress(OSError):
            self._file.close()

    def __call__(self, now: Instant, fleet: Fleet) -> None:
        """Take the fleet's state after a cycle of the main loop."""
        self._turn += 1
        if self._full or self._turn % TURNS:
            return
        write_f64_le(self._waiting, now / NANOSECONDS)
        for body in fleet.bodies:
            body.write_truth(self._waiting)
        if self._turn % LOOP_HZ == 0:
            self._write()

    def _write(self) -> None:
        """Write what is waiting; a full disk ends the record, not the flight."""
        if self._full:
            return
        try:
            self._file.write(self._waiting.getvalue())
            self._file.flush()
        except OSError:
            self._full = True
        self._waiting.truncate(0)


def read_truth(path: Path) -> dict[str, Array]:
    """Return the complete rows so far: `time_s` (T,) since the clock's epoch, and each of `QUANTITIES` (T, V).

    Raises:
        TruthError: the file isn't a record of ground truth.
    """
    with path.open("rb") as file:
        head = file.read(HEADER.size)
        if len(head) < HEADER.size or head[: len(MAGIC)] != MAGIC:
            raise TruthError(f"{path} is not a record of ground truth")
        vehicles = HEADER.unpack(head)[1]
        width = 1 + len(QUANTITIES) * vehicles
        count = (path.stat().st_size - HEADER.size) // (8 * width)
        time_s, columns = np.empty(count), np.empty((len(QUANTITIES), count * vehicles))
        at_once = max(1, BLOCK_BYTES // (8 * width))
        for begin in range(0, count, at_once):
            rows = np.fromfile(file, "<f8", count=min(at_once, count - begin) * width).reshape(-1, width)
            time_s[begin : begin + at_once] = rows[:, 0]
            some = columns[:, begin * vehicles : (begin + at_once) * vehicles]
            columns_of(rows[:, 1:].reshape(-1, len(QUANTITIES)), some)
    return {"time_s": time_s, **dict(zip(QUANTITIES, columns.reshape(len(QUANTITIES), count, vehicles), strict=True))}
