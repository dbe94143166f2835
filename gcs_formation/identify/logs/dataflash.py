"""Reads an ArduPilot log (.bin): setpoints of GUIDED as they were received, or those of its controllers in any mode.

Sources: ArduPilot's ArduPlane/Log.cpp (OFG, NTUN, CTUN), libraries/AP_TECS/AP_TECS.cpp (TECS), ArduCopter/Log.cpp
(GUIP), libraries/AC_AttitudeControl/LogStructure.h (PSCN, PSCE, PSCD), AP_NavEKF3/LogStructure.h (XKF1).
"""

from __future__ import annotations

import math
from collections import defaultdict
from collections.abc import Iterable, Mapping, Sequence
from pathlib import Path
from typing import Any, Final

import numpy as np

from airlink import mavlink as m
from flight_model.arrays import Array, wrap
from gcs_formation.identify.logs.ardupilot_modes import COPTER, PLANE, numbered
from gcs_formation.identify.logs.track import (
    ABEAM_RAD,
    HOVERING_SEEN,
    OVER_GROUND_SEEN,
    Log,
    Mode,
    Track,
    lateral_mps2,
    modes_of,
    spoken,
)
from gcs_formation.vehicle.velocity_setpoint import HEIGHT_S

NAVIGATED: Final = frozenset(
    {"AUTO", "RTL", "LOITER", "CIRCLE", "GUIDED", "FLY_BY_WIRE_B", "CRUISE", "TAKEOFF", "THERMAL", "AVOID_ADSB"}
)
"""ArduPlane's modes in which it controls airspeed and height."""
UNHEADED: Final = frozenset({"FLY_BY_WIRE_B", "CIRCLE", "THERMAL", "LOITER"})
"""Those without a bearing to fly; in LOITER it is that of the circle's centre."""
POSITIONED: Final = frozenset(
    {"AUTO", "GUIDED", "LOITER", "RTL", "CIRCLE", "POSHOLD", "SMART_RTL", "FOLLOW", "ZIGZAG", "AUTO_RTL", "BRAKE"}
)
"""ArduCopter's modes in which it controls its velocity over ground."""
OWN_FIELDS: Final[dict[str, tuple[str, ...]]] = {
    "FMT": ("Type", "Name", "Columns"), "FMTU": ("FmtType", "MultIds"), "PARM": ("Name", "Value"), "MSG": ("Message",),
    "MODE": ("ModeNum",),
}  # fmt: skip
FIELDS: Final[dict[str, tuple[str, ...]]] = {
    "OFG": ("Arsp", "Hdg", "Alt"), "ARSP": ("Airspeed",), "ATT": ("Yaw",), "POS": ("Alt",), "TECS": ("dh",),
    "NTUN": ("NavBrg",), "CTUN": (), "XKF1": ("VN", "VE", "VD"), "NKF1": ("VN", "VE", "VD"),
    "GPS": ("Spd", "GCrs"), "GUIP": ("Type", "vX", "vY", "vZ"), "PSCN": ("VN",), "PSCE": ("VE",), "PSCD": ("PD", "VD"),
}  # fmt: skip
"""Fields that a message must have, where it's used; `OPTIONAL` ones are taken where they are."""
OPTIONAL: Final[dict[str, tuple[str, ...]]] = {
    "TECS": ("h", "hin", "hdem", "spdem", "sp"), "NTUN": ("TAsp",), "CTUN": ("As",), "GUIP": ("aX",),
    "PSCN": ("DVN", "TVN"), "PSCE": ("DVE", "TVE"), "PSCD": ("DPD", "TPD"),
}  # fmt: skip
INSTANCE: Final = ("I", "C")
"""Fields that number the sensor or estimator core; the first one counts."""
SYSTEM_PARAMETERS: Final = ("MAV_SYSID", "SYSID_THISMAV")
BANK_LIMITS: Final = {"ROLL_LIMIT_DEG": math.pi / 180.0, "LIM_ROLL_CD": math.pi / 18000.0}
CENTI: Final = "B"
"""FMTU's multiplier 0.01: GUIP with it is in cm and cm/s, upwards; without, in metres, downwards."""
WANTED: Final = (
    "30 s or more with, of ArduPlane, OFG (setpoints of GUIDED, with ARSP, ATT and POS), or TECS and NTUN (AUTO, RTL, "
    "LOITER, GUIDED, CRUISE, FBWB); of ArduCopter, GUIP (velocities of GUIDED, with XKF1 and POS), or PSCN, PSCE and "
    "PSCD (AUTO, GUIDED, LOITER, RTL, POSHOLD)"
)
TECS_IDENTIFIES: Final = (
    "height {height}; airspeed {speed}; heading: how L1 guidance turns the course to NTUN's NavBrg, not how the "
    "autopilot answers a commanded heading"
)
RECEIVED, LIMITED = (
    "as TECS received it",
    "behind TECS' limits of rate and its filter, which are no part of the time constants",
)
GUIP_IDENTIFIES: Final = "the velocities that were received, with ArduCopter's limits of acceleration and jerk"
PSC_IDENTIFIES: Final = (
    "behind ArduCopter's trajectory generator, whose limits of acceleration and jerk are not part of these constants: "
    "how its position and velocity controllers follow"
)

Table = Mapping[str, Array]


class _Messages:
    """A log's messages, each kind as a table, with what describes the vehicle."""

    def __init__(self, log: Path) -> None:
        self._rows = defaultdict[str, list[tuple[float, ...]]](list)
        self._columns = dict[str, tuple[str, ...]]()
        self._names = dict[int, str]()
        self.formats = dict[str, str]()
        self.multipliers = dict[str, str]()
        self.parameters = dict[str, float]()
        self.firmware = ""
        changes, end_s = list[tuple[float, int]](), 0.0
        for kind, fields in m.dataflash_messages(str(log), (*OWN_FIELDS, *FIELDS)):
            if kind in OWN_FIELDS:
                self._describe(kind, fields, changes)
            elif not any(fields.get(name, 0) for name in INSTANCE):
                self._append(kind, fields)
                end_s = max(end_s, self._rows[kind][-1][0])
        self.end_s = end_s
        self.firmware = self.firmware or self._guessed()
        self.modes: Sequence[Mode] = modes_of((at_s, numbered(self.firmware, number)) for at_s, number in changes)

    def _describe(self, kind: str, fields: Mapping[str, Any], changes: list[tuple[float, int]]) -> None:
        try:
            first, *others = (fields[name] for name in OWN_FIELDS[kind])
            match kind:
                case "FMT":
                    self._names[int(first)], self.formats[str(others[0])] = str(others[0]), str(others[1])
                case "FMTU":
                    self.multipliers[self._names.get(int(first), "")] = str(others[0])
                case "PARM":
                    self.parameters[str(first)] = float(others[0])
                case "MODE":
                    changes.append((float(fields["TimeUS"]) * 1e-6, int(first)))
                case _ if not self.firmware:
                    self.firmware = next((each for each in (PLANE, COPTER) if str(first).startswith(each)), "")
        except KeyError as error:
            raise ValueError(f"a message {kind} without {error}") from error

    def _append(self, kind: str, fields: Mapping[str, Any]) -> None:
        try:
            if kind not in self._columns:
                more = (name for name in OPTIONAL.get(kind, ()) if name in fields)
                self._columns[kind] = (*FIELDS[kind], *more)
            values = (float(fields[name]) for name in self._columns[kind])
            self._rows[kind].append((float(fields["TimeUS"]) * 1e-6, *values))
        except KeyError as error:
            raise ValueError(f"a message {kind} without {error}") from error

    def _guessed(self) -> str:
        return PLANE if {"OFG", "TECS", "NTUN"} & set(self._rows) else COPTER if "PSCN" in self._rows else ""

    def table(self, kind: str) -> dict[str, Array]:
        """Return the columns of a kind, (N,) each, with `at_s`; empty if there are none."""
        if kind not in self._rows:
            return {}
        columns = np.array(self._rows[kind], dtype=np.float64).T
        return dict(zip(("at_s", *self._columns[kind]), columns, strict=True))

    @property
    def system(self) -> int:
        return next((int(self.parameters[name]) for name in SYSTEM_PARAMETERS if name in self.parameters), 1)

    def found(self) -> str:
        """Return in words what the log has: firmware, modes, and messages that tell setpoints or responses."""
        kinds = ", ".join(sorted(self._rows)) or "none"
        lacks = ", ".join(kind for kind in ("OFG", "TECS", "NTUN", "GUIP", "PSCN") if kind not in self._rows)
        flown = spoken(self.modes, self.end_s) or "no mode"
        lacking = f"no messages {lacks}" if lacks else "setpoints of all kinds"
        return f"{self.firmware or 'no ArduPlane or ArduCopter'}, {flown}, messages {kinds}; {lacking}"


def read_dataflash(log: Path) -> Log:
    """Return the tracks of an ArduPilot log.

    Raises:
        OSError: it can't be read.
        ValueError: it isn't such a log, or a message lacks a field.
    """
    messages = _Messages(log)
    made = (_guided_plane, _navigated_plane, _guided_copter, _positioned_copter)
    tracks = [track for make in made if (track := make(messages)) is not None]
    return Log(tracks, f"no vehicle under setpoints ({messages.found()})", WANTED)


def _track(messages: _Messages, setpoints: str, identifies: str, aircraft: str | None) -> Track:
    return Track(messages.system, setpoints, identifies, aircraft, modes=messages.modes)


def _put(track: Track, table: Table, columns: Mapping[str, str], scale: float = 1.0) -> None:
    """Put columns of a table into a track, by the track's names; those that the table lacks are left out."""
    for name, column in columns.items():
        if column in table:
            track.put(name, table["at_s"], scale * table[column])


def _put_airspeed(track: Track, messages: _Messages) -> None:
    for kind, column in (("CTUN", "As"), ("ARSP", "Airspeed")):  # the sensor's, where there is one
        _put(track, messages.table(kind), {"airspeed": column})


def _put_motion(track: Track, messages: _Messages) -> None:
    """Put course, ground speed and climb: of the estimator, or course and speed of GPS."""
    table = messages.table("XKF1") or messages.table("NKF1")
    if table:
        track.put("course", table["at_s"], np.arctan2(table["VE"], table["VN"]))
        track.put("speed seen", table["at_s"], np.hypot(table["VN"], table["VE"]))
        track.put("climb", table["at_s"], -table["VD"])
        return
    table = messages.table("GPS")
    _put(track, table, {"course": "GCrs"}, math.pi / 180.0)
    _put(track, table, {"speed seen": "Spd"})


def _guided_plane(messages: _Messages) -> Track | None:
    """Return what ArduPlane received in GUIDED, as it took it."""
    table = messages.table("OFG")
    if not table:
        return None
    track = _track(messages, "OFG", "", None)
    _put_motion(track, messages)
    _put(track, table, {"speed": "Arsp", "heading": "Hdg", "height": "Alt"})
    _put_airspeed(track, messages)
    _put(track, messages.table("ATT"), {"yaw": "Yaw"}, math.pi / 180.0)
    _put(track, messages.table("POS"), {"alt": "Alt"})
    _put(track, messages.table("TECS"), {"climb": "dh"})
    return track


def _navigated_plane(messages: _Messages) -> Track | None:
    """Return what ArduPlane's navigation commands its controllers, in any mode."""
    tecs, ntun = messages.table("TECS"), messages.table("NTUN")
    if not tecs and not ntun:
        return None
    height, by_navigation = "hin" if "hin" in tecs else "hdem", "TAsp" in ntun
    identifies = TECS_IDENTIFIES.format(
        height=RECEIVED if height == "hin" else LIMITED,
        speed="(NTUN's TAsp) before TECS' limits" if by_navigation else f"(TECS' spdem, TAS) {LIMITED}",
    )
    track = _track(messages, "TECS and NTUN", identifies, "arduplane")
    track.follows, track.seen = NAVIGATED, OVER_GROUND_SEEN
    _put_motion(track, messages)
    _put(track, tecs, {"height": height, "alt": "h", "climb": "dh"})
    if by_navigation:
        _put(track, ntun, {"speed": "TAsp"})
        _put_airspeed(track, messages)
    else:
        _put(track, tecs, {"speed": "spdem", "airspeed": "sp"})
    _put_bearing(track, ntun)
    for name, scale in BANK_LIMITS.items():
        if 0.0 < messages.parameters.get(name, 0.0) * scale < math.pi / 2:
            track.add(0.0, {"lateral": lateral_mps2(messages.parameters[name] * scale)})
            break
    return track


def _put_bearing(track: Track, ntun: Table) -> None:
    """Put the bearing while it is flown.

    CRUISE leaves it as it was while the pilot turns. On a circle, in any mode, it is that of the centre.
    """
    if not ntun:
        return
    at_s, bearing = ntun["at_s"], np.radians(ntun["NavBrg"])
    flown = np.ones(at_s.shape, dtype=bool)
    for mode in track.modes:
        within = (at_s >= mode.begin_s) & (at_s < mode.end_s)
        if mode.name in UNHEADED:
            flown &= ~within
        elif mode.name == "CRUISE":
            flown &= ~within | np.append(True, np.diff(bearing) != 0.0)
    if (course := np.array(track.of.get("course", ()))).size:
        ahead = np.interp(at_s, course[:, 0], np.unwrap(course[:, 1]))
        flown &= np.abs(wrap(bearing - ahead)) < ABEAM_RAD
    track.put("heading", at_s[flown], bearing[flown])


def _guided_copter(messages: _Messages) -> Track | None:
    """Return the velocities that ArduCopter received in GUIDED; height is where the vertical velocity leads."""
    table, positions = messages.table("GUIP"), messages.table("POS")
    if not table:
        return None
    track = _track(messages, "GUIP", GUIP_IDENTIFIES, "arducopter")
    track.seen, track.follows = HOVERING_SEEN, frozenset({"GUIDED", "GUIDED_NOGPS"})
    velocities = (3.0, 4.0) if "aX" in table else (2.0, 3.0)  # position with velocity, and velocity; renumbered in 4.1
    kept = np.isin(table["Type"], velocities)
    at_s, scale = table["at_s"][kept], 0.01 if _in_centimetres(messages) else 1.0
    north, east, up = (scale * table[name][kept] for name in ("vX", "vY", "vZ"))
    track.put("speed", at_s, np.hypot(north, east))
    track.put("heading", at_s, np.arctan2(east, north))
    _put_motion(track, messages)
    _put(track, positions, {"alt": "Alt"})
    if positions:
        climb = up if scale != 1.0 else -up
        track.put("height", at_s, np.interp(at_s, positions["at_s"], positions["Alt"]) + HEIGHT_S * climb)
    return track


def _in_centimetres(messages: _Messages) -> bool:
    """Return whether GUIP is in cm/s and upwards, as before ArduPilot 4.7, by its multiplier; metres are downwards."""
    columns, multipliers = messages.formats.get("GUIP", "").split(","), messages.multipliers.get("GUIP", "")
    index = columns.index("vX") if "vX" in columns else len(multipliers)
    return index >= len(multipliers) or multipliers[index] == CENTI


def _positioned_copter(messages: _Messages) -> Track | None:
    """Return what ArduCopter's trajectory generator commands its position controller, in any mode that has one."""
    north, east, down = (messages.table(kind) for kind in ("PSCN", "PSCE", "PSCD"))
    if not north or not east:
        return None
    track = _track(messages, "PSCN, PSCE and PSCD", PSC_IDENTIFIES, "arducopter")
    track.seen, track.follows = HOVERING_SEEN, POSITIONED
    at_s = north["at_s"]
    commanded = _first(north, "DVN", "TVN"), _interpolated(at_s, east, "DVE", "TVE")
    seen = north["VN"], _interpolated(at_s, east, "VE")
    for (speed, course), (v_north, v_east) in ((("speed", "heading"), commanded), (HOVERING_SEEN[:2], seen)):
        track.put(speed, at_s, np.hypot(v_north, v_east))
        track.put(course, at_s, np.arctan2(v_east, v_north))
    if down:
        track.put("height", down["at_s"], -_first(down, "DPD", "TPD"))
        track.put("alt", down["at_s"], -down["PD"])
        track.put("climb", down["at_s"], -down["VD"])
    return track


def _first(table: Table, *names: str) -> Array:
    found: Iterable[Array] = (table[name] for name in names if name in table)
    return next(iter(found), np.full_like(table["at_s"], np.nan))


def _interpolated(at_s: Array, table: Table, *names: str) -> Array:
    """Return a column at other times, (N,)."""
    return np.interp(at_s, table["at_s"], _first(table, *names))
