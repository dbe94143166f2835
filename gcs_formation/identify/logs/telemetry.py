"""Reads a telemetry log (.tlog): MAVLink setpoints, or the errors that the vehicle's own controllers tell."""

from __future__ import annotations

import math
from collections import defaultdict
from pathlib import Path
from typing import Final

from airlink import mavlink as m
from airlink.frame import Frame
from airlink.messages.command import CommandInt, SetPositionTargetLocalNed
from airlink.messages.system import Heartbeat
from airlink.messages.telemetry import Attitude, GlobalPositionInt, NavControllerOutput, VfrHud
from airlink.stream_parser import StreamParser
from gcs_formation.identify.logs.ardupilot_modes import mode_name
from gcs_formation.identify.logs.track import (
    ABEAM_RAD,
    HOVERING_SEEN,
    OVER_GROUND_SEEN,
    Log,
    Track,
    modes_of,
    spoken,
)
from gcs_formation.record.tlog import read_tlog
from gcs_formation.vehicle.velocity_setpoint import HEIGHT_S

CYCLE_S = 0.02
"""Cycle of a fixed wing's main loop (50 Hz, ArduPlane's SCHED_LOOP_RATE); a setpoint waits for the next one."""
COMMANDS: Final = {
    m.MAV_CMD_GUIDED_CHANGE_SPEED: "speed",
    m.MAV_CMD_GUIDED_CHANGE_HEADING: "heading",
    m.MAV_CMD_GUIDED_CHANGE_ALTITUDE: "height",
}
MIN_LATERAL_MPS2 = 0.05
"""ArduPlane takes a smaller lateral acceleration of a commanded heading as this."""
COMMANDED = "commands 43000 to 43002, DO_REPOSITION, or velocities"
NAVIGATED: Final = frozenset({"AUTO", "RTL", "LOITER", "CIRCLE", "GUIDED", "FLY_BY_WIRE_B", "CRUISE", "TAKEOFF"})
"""ArduPlane's modes in which it flies its own setpoints of airspeed and height."""
HEADED: Final = NAVIGATED - {"FLY_BY_WIRE_B", "CRUISE", "CIRCLE", "LOITER"}
"""Those in which it flies a bearing too, whatever its pilot does."""
OWN_ERRORS = "NAV_CONTROLLER_OUTPUT (what it measured, and its errors)"
OWN_ERRORS_IDENTIFY = (
    "ArduPlane's own setpoints, as its navigation made them: airspeed and height before the limits of its "
    "total-energy control; heading is how its L1 guidance turns the course to the bearing, in whole degrees, not how "
    "it answers a commanded heading"
)
WANTED = (
    f"30 s or more of a vehicle that is commanded speed, heading or height ({COMMANDED}), or of an ArduPlane in "
    "AUTO, RTL, LOITER, CIRCLE, GUIDED, FBWB or CRUISE that sends NAV_CONTROLLER_OUTPUT, and that sends VFR_HUD, "
    "ATTITUDE and GLOBAL_POSITION_INT"
)


class _Telemetry:
    """A log while it is read: for each system, a track of commands and one of its own errors."""

    def __init__(self) -> None:
        self.commanded = defaultdict[int, Track](self._commanded_track)
        self.own = defaultdict[int, Track](self._own_track)
        self.kinds = defaultdict[int, set[str]](set)
        self.modes = defaultdict[int, list[tuple[float, str]]](list)
        self.firmware = dict[int, str]()
        self.end_s = 0.0

    @staticmethod
    def _commanded_track() -> Track:
        return Track(0, f"MAVLink ({COMMANDED})", wait_s=CYCLE_S / 2)

    @staticmethod
    def _own_track() -> Track:
        return Track(0, OWN_ERRORS, OWN_ERRORS_IDENTIFY, "arduplane", OVER_GROUND_SEEN, follows=NAVIGATED)

    def add_frame(self, at_s: float, frame: Frame) -> None:
        self.end_s = at_s
        match frame.message:
            case CommandInt(target_system=system, command=command) as sent if command in COMMANDS:
                _take_command(self.commanded[system], at_s, sent)
            case CommandInt(command=m.MAV_CMD_DO_REPOSITION) as reposition:
                _take_reposition(self.commanded[reposition.target_system], at_s, reposition)
            case SetPositionTargetLocalNed() as velocity:
                _take_velocity(self.commanded[velocity.target_system], at_s, velocity)
            case VfrHud(airspeed_mps=airspeed):
                self._see(frame.system, at_s, "VFR_HUD", {"airspeed": airspeed})
            case Attitude(yaw_rad=yaw):
                self._see(frame.system, at_s, "ATTITUDE", {"yaw": yaw})
            case GlobalPositionInt(vx_mps=north, vy_mps=east) as seen:
                values = {"alt": seen.alt_m, "climb": -seen.vz_mps, "speed seen": math.hypot(north, east)}
                values |= {"course": math.atan2(east, north), "lat": seen.lat_rad, "lon": seen.lon_rad}
                self._see(frame.system, at_s, "GLOBAL_POSITION_INT", values)
            case Heartbeat() as beat if frame.component == m.MAV_COMP_ID_AUTOPILOT1:
                self._take_heartbeat(frame.system, at_s, beat)
            case NavControllerOutput() as errors:
                self.kinds[frame.system].add("NAV_CONTROLLER_OUTPUT")
                self._take_errors(frame.system, at_s, errors)
            case _:
                pass

    def _see(self, system: int, at_s: float, kind: str, values: dict[str, float]) -> None:
        self.kinds[system].add(kind)
        self.commanded[system].add(at_s, values)

    def _take_heartbeat(self, system: int, at_s: float, beat: Heartbeat) -> None:
        self.firmware[system], name = mode_name(beat.autopilot, beat.type, beat.custom_mode)
        self.modes[system].append((at_s, name))

    def _take_errors(self, system: int, at_s: float, errors: NavControllerOutput) -> None:
        """Take ArduPlane's setpoints: what it measured, plus its errors (of airspeed in cm/s)."""
        of = self.commanded[system].of
        if self.firmware.get(system) != "ArduPlane" or "airspeed" not in of or "alt" not in of:
            return
        setpoints = {
            "speed": of["airspeed"][-1][1] + 0.01 * errors.aspd_error_mps,
            "height": of["alt"][-1][1] + errors.alt_error_m,
        }
        abeam_rad = abs(math.remainder(errors.nav_bearing_rad - of["course"][-1][1], math.tau))
        if self.modes[system][-1][1] in HEADED and abeam_rad < ABEAM_RAD:
            setpoints["heading"] = errors.nav_bearing_rad
        self.own[system].add(at_s, setpoints)

    def log(self) -> Log:
        tracks = list[Track]()
        for system, commanded in sorted(self.commanded.items()):
            commanded.system, commanded.modes = system, modes_of(self.modes[system])
            tracks.append(commanded)
            if system in self.own:
                own = self.own[system]
                own.system, own.modes = system, commanded.modes
                own.of |= {name: commanded.of[name] for name in own.seen if name in commanded.of}
                tracks.append(own)
        return Log(tracks, f"no vehicle under setpoints ({self._found()})", WANTED)

    def _found(self) -> str:
        """Return in words which vehicles are in the log, their modes, and what they sent."""
        each = list[str]()
        for system in sorted(self.kinds):
            modes = spoken(modes_of(self.modes[system]), self.end_s)
            sent = ", ".join(sorted(self.kinds[system]))
            each.append(f"vehicle {system}: {self.firmware.get(system, 'no heartbeat')}, {modes or 'no mode'}, {sent}")
        return "; ".join(each) or "no vehicle"


def read_telemetry(log: Path) -> Log:
    """Return the tracks of a telemetry log.

    Raises:
        OSError: it can't be read.
        ValueError: it isn't such a log.
    """
    telemetry, parser, begin_us = _Telemetry(), StreamParser(), None
    for time_us, raw in read_tlog(log):
        begin_us = time_us if begin_us is None else begin_us
        for frame in parser.feed(raw):
            telemetry.add_frame((time_us - begin_us) * 1e-6, frame)
    return telemetry.log()


def _take_command(track: Track, at_s: float, sent: CommandInt) -> None:
    values = {"speed": sent.param2, "heading": math.radians(sent.param2), "height": sent.z}
    track.add(at_s, {COMMANDS[sent.command]: values[COMMANDS[sent.command]]})
    if sent.command == m.MAV_CMD_GUIDED_CHANGE_HEADING:
        track.add(at_s, {"lateral": max(sent.param3, MIN_LATERAL_MPS2)})


def _take_reposition(track: Track, at_s: float, reposition: CommandInt) -> None:
    """Take airspeed, course and height from a command that sends a fixed wing to a position ahead."""
    flies = reposition.param1 > 0.0  # 0 or less: the usual speed, at the formation's end
    if flies and "lat" in track.of:
        track.seen = OVER_GROUND_SEEN
        (_, lat_rad), (_, lon_rad) = track.of["lat"][-1], track.of["lon"][-1]
        north_rad, east_rad = math.radians(reposition.x * 1e-7) - lat_rad, math.radians(reposition.y * 1e-7) - lon_rad
        course_rad = math.atan2(east_rad * math.cos(lat_rad), north_rad)
        track.add(at_s, {"speed": reposition.param1, "heading": course_rad, "height": reposition.z})


def _take_velocity(track: Track, at_s: float, velocity: SetPositionTargetLocalNed) -> None:
    """Take a multirotor's commanded velocity; its height setpoint is where the vertical velocity leads."""
    track.seen, track.aircraft = HOVERING_SEEN, "arducopter"
    if "alt" in track.of:
        north, east, height_m = velocity.vx_mps, velocity.vy_mps, track.of["alt"][-1][1] - HEIGHT_S * velocity.vz_mps
        track.add(at_s, {"speed": math.hypot(north, east), "heading": math.atan2(east, north), "height": height_m})
