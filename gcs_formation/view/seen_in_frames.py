"""What a telemetry log says about its vehicles: where they are, and how their links are, on a grid of time."""

from __future__ import annotations

import math
from collections.abc import Callable, Collection, Sequence
from dataclasses import dataclass, field
from typing import Any

import numpy as np

from airlink import mavlink as m
from airlink.frame import HEADER_V1, HEADER_V2, frame_length, message_id_of
from airlink.messages.payload import MARKER_V2
from airlink.messages.system import (
    HEARTBEAT,
    RADIO_STATUS,
    STATUSTEXT,
    TIMESYNC,
    Heartbeat,
    RadioStatus,
    Statustext,
    Timesync,
)
from airlink.messages.telemetry import (
    BATTERY_STATUS,
    GLOBAL_POSITION_INT,
    SYS_STATUS,
    VFR_HUD,
    BatteryStatus,
    GlobalPositionInt,
    SysStatus,
    VfrHud,
)
from airlink.stream_parser import StreamParser
from flight_model.arrays import Array
from flight_model.earth import GeodeticOrigin
from gcs_formation.view.recording import COLUMN, COLUMNS, RADIO, Rows

STAMP = 8
"""Bytes of a frame's stamp: microseconds since 1970, big-endian."""
MICROSECONDS = 1e6
WINDOW_S = 10.0
"""Losses and rates are of this long before."""
SILENT_S = 5.0
"""A vehicle that was silent for longer has no rates, and a leap in its numbers isn't counted as loss."""
MAX_LOST = 128
"""A larger step of the sequence number means that it began again."""
MAX_TEXTS = 20_000
MAX_VEHICLES = 1000
KINDS = (HEARTBEAT, SYS_STATUS, STATUSTEXT, TIMESYNC, GLOBAL_POSITION_INT, VFR_HUD, BATTERY_STATUS)
READ = frozenset(kind.message_id for kind in KINDS)
"""Frames that are read; of others only the header is."""
TARGET = {20: 2, 21: 0, 23: 4, 66: 2, 75: 30, 76: 30, 84: 50, 86: 50, 111: 16}
"""Where in the payload of what ground stations often send the target system is, by message id."""
GROUND_STATIONS = (m.MAV_TYPE_GCS, m.MAV_TYPE_ONBOARD_CONTROLLER, m.MAV_TYPE_ANTENNA_TRACKER)
NameOfMode = Callable[[Heartbeat], str]
BITS, KILO = 8, 1e3
RADIO_STALE_S = 5.0
"""A radio reports about once a second; older reports say nothing about now."""
UNKNOWN_LEVEL = 255
SEVERITIES = ("emergency", "alert", "critical", "error", "warning", "notice", "info", "debug")
EARLIEST_US, LATEST_US = 0, 2**62


@dataclass
class _Seen:
    """What is known of a vehicle by the frames so far."""

    row: list[float] = field(default_factory=lambda: [math.nan] * len(COLUMNS))
    autopilot: bool = False
    sequences: dict[int, int] = field(default_factory=dict[int, int])
    """Last sequence number of each component."""
    counted: list[tuple[float, int, int]] = field(default_factory=list[tuple[float, int, int]])
    """Time, frames received and lost up to it, at each point of the grid within the window."""
    frames: int = 0
    lost: int = 0
    bytes_down: int = 0
    bytes_up: float = 0.0
    rates: list[tuple[float, int, float]] = field(default_factory=list[tuple[float, int, float]])
    received_s: float = -math.inf
    position_s: float = -math.inf
    mode: str = ""
    armed: bool | None = None
    chunks: dict[int, str] = field(default_factory=dict[int, str])


class FrameReader:
    """Reads a log's bytes as they come; keeps a row for each vehicle at each point of a grid of time."""

    def __init__(
        self,
        step_s: float,
        name_of_mode: NameOfMode,
        origin: GeodeticOrigin | None = None,
        by_radio: Collection[int] | None = None,
        *,
        copies: bool = False,
    ) -> None:
        """Sample every `step_s`; positions count from `origin`, or from the first position.

        `copies`: the log has a copy for each vehicle of what is sent to all of them, as ours do.

        A radio's report doesn't say of whom it is: it is taken to be of the systems in `by_radio`, None: of all.
        """
        self._copies = copies
        self._by_radio, self._radio, self._radio_s = by_radio, list[float](), -math.inf
        self._step_s, self._name_of_mode, self._origin = step_s, name_of_mode, origin
        self._pending, self._out_of_step = b"", False
        self._begin_us: int | None = None
        self._next_s, self._asked = 0.0, dict[int, float]()
        self.seen = dict[int, _Seen]()
        self.times_s = list[float]()
        self.snapshots = list[dict[int, list[float]]]()
        self.events = list[dict[str, Any]]()

    @property
    def origin(self) -> GeodeticOrigin | None:
        """From where positions count."""
        return self._origin

    def begins_at(self, epoch_us: int) -> None:
        """Count times from this instant instead of the first frame's."""
        self._begin_us = epoch_us

    def feed(self, data: bytes) -> None:
        """Read further bytes; what isn't a stamped frame is skipped."""
        data, at, end = self._pending + data, 0, len(self._pending) + len(data)
        while at + STAMP + HEADER_V2 <= end:
            length = frame_length(data, at + STAMP)
            if length == 0 or not self._is_plausible(data, at):
                at += 1
                self._out_of_step = True
                continue
            if at + STAMP + length > end:
                break
            raw = data[at + STAMP : at + STAMP + length]
            if self._out_of_step and not StreamParser().feed(raw):  # after garbage, begin with a valid checksum
                at += 1
                continue
            self._out_of_step = False
            self._frame(int.from_bytes(data[at : at + STAMP], "big"), raw)
            at += STAMP + length
        self._pending = data[at:]

    @property
    def begun(self) -> bool:
        """Whether it is known when times began."""
        return self._begin_us is not None

    def read_new(self) -> tuple[Array, list[int], Rows]:
        """Return the points of the grid since the last call: times, systems, and rows of these."""
        systems = [system for system, seen in self.seen.items() if seen.autopilot]
        times_s, rows = np.array(self.times_s), table(self.snapshots, systems)
        self.times_s, self.snapshots = [], []
        return times_s, systems, rows

    def finish(self) -> None:
        """Take the last point of the grid."""
        if self.seen:
            self._sample(self._next_s)

    def _is_plausible(self, data: bytes, at: int) -> bool:
        stamp_us = int.from_bytes(data[at : at + STAMP], "big")
        begin_us = self._begin_us
        if begin_us is None:
            return EARLIEST_US < stamp_us < LATEST_US
        return abs(stamp_us - begin_us) < 30 * 86400 * 10**6

    def _frame(self, stamp_us: int, raw: bytes) -> None:
        if self._begin_us is None:
            self._begin_us = stamp_us
        at_s = (stamp_us - self._begin_us) / MICROSECONDS
        while at_s >= self._next_s:
            if at_s - self._next_s > 100 * self._step_s:  # a gap: one row before it, one after
                self._sample(self._next_s)
                self._next_s = math.floor(at_s / self._step_s) * self._step_s
            self._sample(self._next_s)
            self._next_s += self._step_s
        version_2 = raw[0] == MARKER_V2
        system, component, sequence = (raw[5], raw[6], raw[4]) if version_2 else (raw[3], raw[4], raw[2])
        message_id = message_id_of(raw)
        if message_id == RADIO_STATUS.message_id:
            self._reported(raw, at_s)
            return
        seen = self.seen.get(system)
        if seen is None:
            if message_id != HEARTBEAT.message_id or len(self.seen) >= MAX_VEHICLES:
                self._sent(raw, message_id, at_s)
                return
            seen = self.seen[system] = _Seen()
        if seen.autopilot:
            self._count(seen, component, sequence, len(raw), at_s)
        else:
            self._sent(raw, message_id, at_s)
        if message_id in READ:
            for frame in StreamParser().feed(raw):
                if frame.message is not None:
                    self._message(system, seen, frame.message, at_s)

    def _count(self, seen: _Seen, component: int, sequence: int, size: int, at_s: float) -> None:
        before = seen.sequences.get(component)
        missing = 0 if before is None else (sequence - before - 1) % 256
        if missing < MAX_LOST and at_s - seen.received_s < SILENT_S:
            seen.lost += missing
        seen.sequences[component], seen.received_s = sequence, at_s
        seen.frames += 1
        seen.bytes_down += size

    def _sent(self, raw: bytes, message_id: int, at_s: float) -> None:
        """Count a ground station's frame for the vehicles that it is for, and remember its clock requests."""
        if message_id == TIMESYNC.message_id:
            for frame in StreamParser().feed(raw):
                if isinstance(frame.message, Timesync) and frame.message.tc1_ns == 0:
                    self._asked[frame.message.ts1_ns] = at_s
                    if len(self._asked) > MAX_VEHICLES:
                        del self._asked[next(iter(self._asked))]
        offset = TARGET.get(message_id)
        target = 0 if offset is None else _byte(raw, offset)
        reached = [seen for system, seen in self.seen.items() if seen.autopilot and target in {0, system}]
        for seen in reached:
            seen.bytes_up += len(raw) / len(reached) if self._copies else len(raw)

    def _reported(self, raw: bytes, at_s: float) -> None:
        """Keep what a radio says; it is neither a vehicle's frame nor one for a vehicle."""
        for frame in StreamParser().feed(raw):
            if isinstance(frame.message, RadioStatus):
                status = frame.message
                levels = (status.rssi, status.remrssi, status.noise, status.remnoise)
                self._radio = [math.nan if each == UNKNOWN_LEVEL else float(each) for each in levels]
                self._radio.append(float(min(status.txbuf, 100)))
                self._radio_s = at_s

    def _message(self, system: int, seen: _Seen, message: object, at_s: float) -> None:
        row = seen.row
        match message:
            case Heartbeat(type=kind) if kind not in GROUND_STATIONS and message.autopilot != m.MAV_AUTOPILOT_INVALID:
                seen.autopilot = True
                self._heartbeat(system, seen, message, at_s)
            case SysStatus(battery_remaining=percent) if percent >= 0:
                row[COLUMN["battery"]] = percent / 100.0
            case BatteryStatus(battery_remaining=percent, id=0) if percent >= 0:
                row[COLUMN["battery"]] = percent / 100.0
            case GlobalPositionInt():
                self._take_position(seen, message, at_s)
            case VfrHud(airspeed_mps=airspeed_mps):
                row[COLUMN["airspeed_mps"]] = airspeed_mps
            case Timesync(tc1_ns=answered, ts1_ns=asked) if answered != 0:
                begun_s = self._asked.get(asked)
                if begun_s is not None:
                    row[COLUMN["delay_s"]] = (at_s - begun_s) / 2.0
            case Statustext():
                self._text(system, seen, message, at_s)
            case _:
                pass

    def _heartbeat(self, system: int, seen: _Seen, heartbeat: Heartbeat, at_s: float) -> None:
        mode, armed = self._name_of_mode(heartbeat), bool(heartbeat.base_mode & m.MAV_MODE_FLAG_SAFETY_ARMED)
        seen.row[COLUMN["armed"]] = float(armed)
        if mode != seen.mode:
            seen.mode = mode
            self._event(system, "mode", mode, at_s)
        if armed is not seen.armed:
            seen.armed = armed
            self._event(system, "arming", "armed" if armed else "disarmed", at_s)

    def _take_position(self, seen: _Seen, position: GlobalPositionInt, at_s: float) -> None:
        if position.lat_rad == 0.0 and position.lon_rad == 0.0:
            return
        if self._origin is None:
            self._origin = GeodeticOrigin(position.lat_rad, position.lon_rad, position.alt_m - position.relative_alt_m)
        north_m, east_m, down_m = self._origin.to_ned(position.lat_rad, position.lon_rad, position.alt_m)
        ground_mps, row = math.hypot(position.vx_mps, position.vy_mps), seen.row
        heading = position.hdg_rad if math.isfinite(position.hdg_rad) else math.atan2(position.vy_mps, position.vx_mps)
        row[:3] = north_m, east_m, -down_m
        row[COLUMN["heading_rad"]], row[COLUMN["climb_mps"]] = heading, -position.vz_mps
        if math.isnan(row[COLUMN["airspeed_mps"]]):
            row[COLUMN["airspeed_mps"]] = ground_mps
        row[COLUMN["airborne"]] = float(position.relative_alt_m > 2.0)
        seen.position_s = at_s

    def _text(self, system: int, seen: _Seen, text: Statustext, at_s: float) -> None:
        whole = seen.chunks.pop(text.id, "") + text.text if text.id else text.text
        if text.id and len(text.text) == 50 and len(whole) < 1000:
            seen.chunks[text.id] = whole
            return
        severity = SEVERITIES[text.severity] if text.severity < len(SEVERITIES) else str(text.severity)
        self._event(system, "statustext", whole, at_s, severity=severity)

    def _event(self, system: int, kind: str, text: str, at_s: float, **details: str) -> None:
        if len(self.events) < MAX_TEXTS:
            self.events.append({"t_s": round(at_s, 3), "kind": kind, "text": text, "vehicle": str(system), **details})

    def _sample(self, at_s: float) -> None:
        snapshot = dict[int, list[float]]()
        for system, seen in self.seen.items():
            if seen.autopilot:
                snapshot[system] = row = self._sampled(seen, at_s)
                if at_s - self._radio_s < RADIO_STALE_S and (self._by_radio is None or system in self._by_radio):
                    row[COLUMN[RADIO[0]] : COLUMN[RADIO[-1]] + 1] = self._radio
        self.times_s.append(at_s)
        self.snapshots.append(snapshot)

    def _sampled(self, seen: _Seen, at_s: float) -> list[float]:
        row = seen.row.copy()
        age_s = at_s - seen.position_s
        row[COLUMN["age_s"]] = age_s if math.isfinite(age_s) else math.nan
        row[COLUMN["active"]] = row[COLUMN["leads"]] = row[COLUMN["yielding"]] = 0.0
        seen.counted.append((at_s, seen.frames, seen.lost))
        seen.rates.append((at_s, seen.bytes_down, seen.bytes_up))
        while len(seen.counted) > 2 and at_s - seen.counted[0][0] > WINDOW_S:
            del seen.counted[0], seen.rates[0]
        begin_s, frames, lost = seen.counted[0]
        received, missed = seen.frames - frames, seen.lost - lost
        if at_s > begin_s:
            row[COLUMN["loss"]] = missed / (missed + received) if received else math.nan
            _, down, up = seen.rates[0]
            row[COLUMN["rate_down_kbps"]] = BITS * (seen.bytes_down - down) / (at_s - begin_s) / KILO
            row[COLUMN["rate_up_kbps"]] = BITS * (seen.bytes_up - up) / (at_s - begin_s) / KILO
        return row


def _byte(raw: bytes, offset: int) -> int:
    """Return a byte of a frame's payload; MAVLink 2 leaves out zeros at the end."""
    header = HEADER_V2 if raw[0] == MARKER_V2 else HEADER_V1
    return raw[header + offset] if offset < raw[1] else 0


def table(snapshots: Sequence[dict[int, list[float]]], systems: Sequence[int]) -> Rows:
    """Return snapshots as rows of some systems; NaN before one was received."""
    unknown = [math.nan] * len(COLUMNS)
    rows = [[each.get(system, unknown) for system in systems] for each in snapshots]
    return np.array(rows, dtype=np.float32).reshape(len(rows), len(systems), len(COLUMNS))


def of(rows: Rows, systems: Sequence[int], wanted: Sequence[int]) -> Rows:
    """Return rows of the wanted systems; NaN for those that haven't been received."""
    found = np.full((len(rows), len(wanted), rows.shape[2]), np.nan, dtype=np.float32)
    for column, system in enumerate(wanted):
        if system in systems:
            found[:, column] = rows[:, systems.index(system)]
    return found
