"""What the page shows of any flight: vehicles, ticks of numbers, and events; whatever they were read from."""

from __future__ import annotations

import json
import math
import struct
from collections.abc import Mapping, Sequence
from typing import Any, Literal, NamedTuple, Protocol

import numpy as np
import numpy.typing as npt

from flight_model.arrays import Array, Indices

Rows = npt.NDArray[np.float32]
"""(T, V, C): ticks, vehicles, `COLUMNS`."""
State = Literal["live", "silent", "concluding", "ended", "killed", "log"]
POSITION = ("north_m", "east_m", "height_m")
STATE = (*POSITION, "airspeed_mps", "heading_rad", "climb_mps")
SETPOINT = ("setpoint_speed_mps", "setpoint_heading_rad", "setpoint_height_m")
SLOT = ("slot_north_m", "slot_east_m", "slot_height_m")
ERROR = ("error_x_m", "error_y_m", "error_z_m")
LINK = ("age_s", "delay_s", "up_s", "down_s", "jitter_s", "margin_used")
FLAGS = ("active", "leads", "yielding", "airborne")
SEEN = ("loss", "rate_down_kbps", "rate_up_kbps", "battery", "armed")
"""What only frames tell: share lost from vehicle to ground, kbit/s each way, battery left (0 to 1), whether armed."""
RADIO = ("radio_rssi", "radio_remrssi", "radio_noise", "radio_remnoise", "radio_txbuf_percent")
"""What the radio at our end last reported by RADIO_STATUS of a vehicle's link: levels in its own unit, free buffer."""
COLUMNS = (*STATE, *SETPOINT, *SLOT, *ERROR, *LINK, *FLAGS, *SEEN, *RADIO)
COLUMN = {name: index for index, name in enumerate(COLUMNS)}
MAX_ROWS = 60_000
"""Rows, a vehicle's at a tick, in one answer."""
HEAD = struct.Struct("<I")
ALIGN = 8


class Times(NamedTuple):
    """(T,) of each tick: clock time, mission time (NaN before the path begins), and the number of its phase."""

    time_s: Array
    mission_s: Array
    phase: Array


class Recording(Protocol):
    """A flight, finished or still growing."""

    @property
    def vehicles(self) -> Sequence[str]:
        """Their names, in the order of the rows."""
        ...

    @property
    def state(self) -> State:
        """Whether it still grows, and why not."""
        ...

    @property
    def generation(self) -> int:
        """Changes when ticks that were read before are others now."""
        ...

    @property
    def times(self) -> Times:
        """When the ticks were."""
        ...

    @property
    def events(self) -> Sequence[Mapping[str, Any]]:
        """As lines of events.jsonl, in the order in which they are found."""
        ...

    @property
    def phases(self) -> Sequence[str]:
        """The phases by their numbers."""
        ...

    def rows(self, ticks: Indices) -> Rows:
        """Return the rows of some ticks."""
        ...

    def scene(self) -> Mapping[str, Any]:
        """Return what doesn't move: name, path, fence, ground, limits."""
        ...

    def poll(self, wall_s: float) -> None:
        """Read what is new; `wall_s`: a clock that only goes on."""
        ...


def described(recording: Recording) -> dict[str, Any]:
    """Return what a page needs to know before any tick."""
    time_s = recording.times.time_s
    return {
        "vehicles": list(recording.vehicles),
        "columns": list(COLUMNS),
        "phases": list(recording.phases),
        "state": recording.state,
        "generation": recording.generation,
        "ticks": int(time_s.size),
        "from_s": float(time_s[0]) if time_s.size else None,
        "to_s": float(time_s[-1]) if time_s.size else None,
        "events": len(recording.events),
        "scene": dict(recording.scene()),
    }


def state_at(recording: Recording, at_s: float | None) -> dict[str, Any]:
    """Return a tick as JSON: the newest, or the last one up to a time; without any, everything in it is unknown."""
    times = recording.times
    last = times.time_s.size - 1
    tick = last if at_s is None else max(0, int(np.searchsorted(times.time_s, at_s + 1e-9, side="right")) - 1)
    live = recording.state in {"live", "silent"}
    if last < 0:
        nothing = {"time_s": None, "mission_time_s": None, "phase": _last_phase(recording), "live": live}
        return nothing | {"vehicles": {name: _vehicle(None) for name in recording.vehicles}}
    rows = recording.rows(np.array([min(tick, last)]))[0]
    tick = min(tick, last)
    return {
        "time_s": round(float(times.time_s[tick]), 6),
        "mission_time_s": _number(times.mission_s[tick]),
        "phase": _phase(recording, tick),
        "live": live,
        "vehicles": {name: _vehicle(row) for name, row in zip(recording.vehicles, rows, strict=True)},
    }


def _phase(recording: Recording, tick: int) -> str:
    number = int(recording.times.phase[tick])
    return recording.phases[number] if 0 <= number < len(recording.phases) else "unknown"


def _last_phase(recording: Recording) -> str:
    named = (str(event.get("text")) for event in reversed(recording.events) if event.get("kind") == "phase")
    return next(named, "unknown").partition(" to ")[0]


def _vehicle(row: npt.NDArray[np.float32] | None) -> dict[str, Any]:
    def of(name: str, scale: float = 1.0) -> float | None:
        return None if row is None else _number(scale * float(row[COLUMN[name]]))

    return {
        **{name: of(name) for name in (*STATE, *SETPOINT)},
        "error_m": [of(name) for name in ERROR],
        **{f"{name}_ms": of(f"{name}_s", 1e3) for name in ("delay", "up", "down", "jitter")},
        **{
            name: of(name)
            for name in ("age_s", "margin_used", "loss", "rate_down_kbps", "rate_up_kbps", "battery", *RADIO)
        },
        **{name: None if row is None else bool(row[COLUMN[name]] > 0) for name in (*FLAGS, "armed")},
    }


def _number(value: float) -> float | None:
    return round(float(value), 6) if math.isfinite(value) else None


def chosen(count: int, vehicles: int, begin: int, end: int, rows: int = MAX_ROWS) -> Indices:
    """Return the ticks of [begin, end) evenly thinned out to at most `rows` rows, the last one included."""
    begin, end = max(0, min(begin, count)), max(0, min(end, count))
    rows_max = max(2, min(rows, MAX_ROWS) // max(1, vehicles))
    if end - begin <= rows_max:
        return np.arange(begin, end, dtype=np.intp)
    return np.unique(np.linspace(begin, end - 1, rows_max).astype(np.intp))


def packed(recording: Recording, ticks: Indices) -> bytes:
    """Return ticks as bytes: a length, a line of JSON padded to 8 bytes, three float64 a tick, float32 values.

    All numbers are little-endian. The three are clock time, mission time and phase; values are those of `COLUMNS`, by
    tick and vehicle.
    """
    times = recording.times
    head = {"count": int(ticks.size), "vehicles": len(recording.vehicles), "columns": len(COLUMNS)}
    head |= {"first": int(ticks[0]) if ticks.size else 0, "generation": recording.generation}
    line = json.dumps(head).encode()
    line += b" " * (-(HEAD.size + len(line)) % ALIGN)
    three = np.stack([each[ticks] for each in times], axis=1).astype("<f8")
    return HEAD.pack(len(line)) + line + three.tobytes() + recording.rows(ticks).astype("<f4").tobytes()
