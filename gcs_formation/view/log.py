"""A recording from a telemetry log (.tlog) of any ground station."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import Any

import numpy as np

from airlink import mavlink as m
from airlink.messages.system import Heartbeat
from flight_model.arrays import Array, Indices
from formation_scenario.bounded_read import require_file
from gcs_formation.errors import RecordError
from gcs_formation.vehicle.mode_names import COPTER, PLANE, PLANE_TYPES, PX4
from gcs_formation.view.recording import COLUMN, Rows, State, Times
from gcs_formation.view.scene import degrees
from gcs_formation.view.seen_in_frames import FrameReader, of

STEP_S = 0.2
MAX_SAMPLES = 100_000
"""Points of the grid; of a longer log every second one is kept, and so on."""
CHUNK = 2**20
ALLOWED = "allowed: a telemetry log as MAVProxy, Mission Planner, QGroundControl and `run` write it"


def name_of_mode(heartbeat: Heartbeat) -> str:
    """Return a mode in words, by the family that a heartbeat is of."""
    names: Mapping[int, str] = {}
    if heartbeat.autopilot == m.MAV_AUTOPILOT_PX4:
        names = PX4
    elif heartbeat.autopilot == m.MAV_AUTOPILOT_ARDUPILOTMEGA:
        names = PLANE if heartbeat.type in PLANE_TYPES else COPTER
    return names.get(heartbeat.custom_mode, f"mode {heartbeat.custom_mode}")


class LogRecording:
    """A telemetry log, read whole: positions, modes, texts, and links as far as frames tell them."""

    state: State = "log"
    generation = 0
    phases = ("log",)

    def __init__(self, path: Path) -> None:
        """Read the log.

        Raises:
            RecordError: it can't be read, or no vehicle is in it.
        """
        self._path, reader = path, FrameReader(STEP_S, name_of_mode)
        taken = list[tuple[Array, list[int], Rows]]()
        try:
            require_file(path)
            with path.open("rb") as file:
                while chunk := file.read(CHUNK):
                    reader.feed(chunk)
                    taken.append(reader.read_new())
        except OSError as error:
            raise RecordError(f"cannot read {path}: {error.strerror or error}; {ALLOWED}") from error
        reader.finish()
        self._origin = reader.origin
        systems = sorted(system for system, seen in reader.seen.items() if seen.autopilot)
        if not systems:
            raise RecordError(f"found no vehicle's heartbeat in {path}; {ALLOWED}")
        taken.append(reader.read_new())
        time_s = np.concatenate([times_s for times_s, _, _ in taken])
        every = 1 + time_s.size // MAX_SAMPLES
        time_s, self._rows = (
            time_s[::every],
            np.concatenate([of(rows, own, systems) for _, own, rows in taken])[::every],
        )
        known = np.flatnonzero(np.isfinite(self._rows[:, :, COLUMN["airborne"]]).any(axis=1))
        begin = int(known[0]) if known.size else 0
        self._rows, time_s = self._rows[begin:], time_s[begin:]
        self._vehicles, self._events = [str(system) for system in systems], reader.events
        self._times = Times(time_s, np.full(time_s.size, np.nan), np.zeros(time_s.size))

    @property
    def vehicles(self) -> Sequence[str]:
        """The systems that sent heartbeats of an autopilot."""
        return self._vehicles

    @property
    def times(self) -> Times:
        """Seconds since the first frame."""
        return self._times

    @property
    def events(self) -> Sequence[Mapping[str, Any]]:
        """Modes, arming and texts."""
        return self._events

    def rows(self, ticks: Indices) -> Rows:
        """Return the rows of some ticks."""
        return self._rows[ticks]

    def scene(self) -> Mapping[str, Any]:
        """Return the log's name, and where positions count from; nothing else is known of it."""
        return {"name": self._path.name, **({} if self._origin is None else {"origin": degrees(self._origin)})}

    def poll(self, wall_s: float) -> None:
        """Do nothing: a log is read once."""
