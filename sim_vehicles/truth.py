"""Ground truth of a fleet: a file of rows of float64 that can be read while it is being written."""

from __future__ import annotations

import struct
from collections.abc import Sequence
from contextlib import suppress
from pathlib import Path
from types import TracebackType
from typing import Final, Self

from librt.strings import BytesWriter, write_f64_le

from airlink.clock import NANOSECONDS, Instant
from flight_model.arrays import Array, columns_of, mapped
from sim_vehicles.airframe.in_air import InAir
from sim_vehicles.board_clock import LOOP_HZ
from sim_vehicles.fleet import Fleet

MAGIC = b"truth\x00\x00\x03"
NUMBER_BYTES = 8
TURNS: Final = 2
"""Number of cycles of the main loop for each row."""
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
"""Values of each vehicle: NED from the origin, height and climb upwards; the sum of all disturbances without the wind;
1 in flight, 0 on the ground."""


class TruthError(Exception):
    """A file that isn't a record of ground truth."""


class TruthWriter:
    """Appends rows to the file; pass it to a fleet as its truth listener."""

    def __init__(self, path: Path, vehicles: int, *, at_once: bool = False) -> None:
        """Create the file; `at_once`: each row is written at its instant, so that others know it."""
        self._file = path.open("wb")
        self._file.write(HEADER.pack(MAGIC, vehicles))
        self._turn, self._full = 0, False
        self._waiting = BytesWriter()
        self._every = TURNS if at_once else LOOP_HZ

    def __enter__(self) -> Self:
        """Return the writer."""
        return self

    def __exit__(
        self, kind: type[BaseException] | None, error: BaseException | None, trace: TracebackType | None
    ) -> None:
        """Write the buffer and close the file."""
        self._write()
        with suppress(OSError):
            self._file.close()

    def __call__(self, now: Instant, fleet: Fleet) -> None:
        """Take the fleet's state after a cycle of the main loop."""
        self.take(now, fleet.bodies)

    def take(self, now: Instant, bodies: Sequence[InAir]) -> None:
        """Take the state of bodies after a cycle of the emulators' main loop."""
        self._turn += 1
        if self._full or self._turn % TURNS:
            return
        write_f64_le(self._waiting, now / NANOSECONDS)
        for body in bodies:
            body.write_truth(self._waiting)
        if self._turn % self._every == 0:
            self._write()

    def _write(self) -> None:
        """Write the buffer; a full disk ends the record, not the flight."""
        if self._full:
            return
        try:
            self._file.write(self._waiting.getvalue())
            self._file.flush()
        except OSError:
            self._full = True
        self._waiting.truncate(0)


class TruthRecord:
    """The complete rows of a file so far."""

    def __init__(self, path: Path) -> None:
        """Open the file.

        Raises:
            TruthError: it isn't a record of ground truth.
            FileNotFoundError: there is none.
        """
        with path.open("rb") as file:
            head = file.read(HEADER.size)
        if len(head) < HEADER.size or head[: len(MAGIC)] != MAGIC:
            raise TruthError(f"{path} is not a record of ground truth")
        self._vehicles: int = HEADER.unpack(head)[1]
        self._path, self._width = path, 1 + len(QUANTITIES) * self._vehicles
        self.rows: int = (path.stat().st_size - HEADER.size) // (NUMBER_BYTES * self._width)

    def position_of(self, column: int) -> tuple[float, float, float]:
        """Return a vehicle's newest north, east and height, m; there must be a row."""
        first = 1 + column * len(QUANTITIES)
        north_m, east_m, height_m = self._mapped()[-1, first : first + 3].tolist()
        return north_m, east_m, height_m

    @property
    def last_s(self) -> float:
        """Time of the last row, since the clock's epoch; there must be one."""
        return float(self._mapped()[-1, 0])

    def _mapped(self) -> Array:
        return mapped(self._path, HEADER.size, (self.rows, self._width))

    def between(self, from_s: float, to_s: float) -> dict[str, Array]:
        """Return the rows from the last at or before `from_s` to the first after `to_s`, if possible at least two.

        Returns:
            `time_s` (T,) since the clock's epoch, and each of `QUANTITIES` (T, V).
        """
        rows = self._mapped()
        times_s = rows[:, 0]
        first = max(0, min(int(times_s.searchsorted(from_s, side="right")) - 1, self.rows - 2))
        end = max(first + 2, int(times_s.searchsorted(to_s, side="right")) + 1)
        some = rows[first:end]
        columns = columns_of(some[:, 1:].reshape(len(some), self._vehicles, len(QUANTITIES)))
        return {"time_s": some[:, 0].copy(), **dict(zip(QUANTITIES, columns, strict=True))}
