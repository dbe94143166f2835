"""Reads what a vehicle was commanded and how it flew from a telemetry log, on a uniform time grid."""

from __future__ import annotations

import math
from collections import defaultdict
from collections.abc import Mapping
from dataclasses import dataclass, field
from pathlib import Path

import numpy as np

from airlink import mavlink as m
from airlink.frame import Frame, StreamParser
from airlink.messages.command import CommandInt, SetPositionTargetLocalNed
from airlink.messages.telemetry import Attitude, GlobalPositionInt, VfrHud
from flight_model.arrays import Array
from flight_model.slot import CHANNELS
from formation_scenario.bounded_read import require_file
from gcs_formation.errors import RecordError
from gcs_formation.record.tlog import read_tlog
from gcs_formation.vehicle.command_delivery import REPEAT_S
from gcs_formation.vehicle.velocity_setpoint import HEIGHT_S

STEP_S = 0.1
"""Step of the grid."""
SILENT_S = 1.0
"""A state older than this breaks the recording."""
SETPOINT_SILENT_S = 2.5 * REPEAT_S
"""A setpoint older than this breaks it too. Constant ones are repeated each `REPEAT_S` and a tick; one may be lost."""
SETTLING_S = 15.0
"""Take-off transients within this time aren't used."""
CYCLE_S = 0.02
"""Cycle of a fixed wing's main loop (50 Hz, ArduPlane's SCHED_LOOP_RATE); a setpoint waits for the next one."""
MOVES_MPS = 1.0
"""Below this speed a course isn't used."""
LEAST_S = 30.0
"""Shorter stretches under setpoints aren't used."""
COMMANDS = {
    m.MAV_CMD_GUIDED_CHANGE_SPEED: "speed",
    m.MAV_CMD_GUIDED_CHANGE_HEADING: "heading",
    m.MAV_CMD_GUIDED_CHANGE_ALTITUDE: "height",
}
DATAFLASH = ".bin"
DATAFLASH_FIELDS = {
    "OFG": (("speed", "Arsp", 1.0), ("heading", "Hdg", 1.0), ("height", "Alt", 1.0)),
    "ARSP": (("airspeed", "Airspeed", 1.0),),
    "ATT": (("yaw", "Yaw", math.pi / 180.0),),
    "POS": (("alt", "Alt", 1.0),),
    "TECS": (("climb", "dh", 1.0),),
}
"""For each message type: the quantity, its field, and the factor to our unit."""
SYSTEM_PARAMETERS = ("MAV_SYSID", "SYSID_THISMAV")
FREELY_MPS2 = 1e3
"""Lateral acceleration that doesn't limit turns."""
LABELS = {
    "airspeed": "airspeed, m/s",
    "speed seen": "ground speed, m/s",
    "yaw": "heading, degrees",
    "course": "course, degrees",
    "alt": "height, m",
}
SEEN = ("airspeed", "yaw", "alt", "climb")
SENT_TO_PLACES_SEEN = ("airspeed", "course", "alt", "climb")
"""For a vehicle commanded to places ahead: it flies courses over ground."""
HOVERING_SEEN = ("speed seen", "course", "alt", "climb")
"""For a vehicle commanded velocities over ground."""


@dataclass(frozen=True)
class Recording:
    """One vehicle's longest stretch under setpoints: K points, `STEP_S` apart."""

    system: int
    seen: Array
    """(4, K) airspeed (m/s), heading (rad, not wrapped), height (m above sea level) and climb (m/s)."""
    commanded: Array
    """(3, K) setpoints of speed, heading and height as received: the mean over the step that begins there."""
    delay_s: float = 0.0
    """Round-trip delay of the link, which isn't the vehicle's lag."""
    names: tuple[str, ...] = SEEN
    """Names of the quantities in `seen`."""
    lateral_mps2: Array = field(default_factory=lambda: np.array([FREELY_MPS2]))
    """(K,) or (1,) lateral acceleration of commanded turns, m/s2: it limits the turn rate, the more the faster it
    flies."""

    samples: tuple[tuple[Array, Array], ...] = ()
    """Times, in steps since the first point, and values of each of the three channels' measurements; if empty, `seen`.
    """

    def measured(self) -> tuple[tuple[Array, Array], ...]:
        """Return the times, in steps since the first point, and values of each channel's measurements."""
        points: Array = np.arange(self.seen.shape[1], dtype=np.float64)
        return self.samples or tuple((points, each) for each in self.seen[:3])

    @property
    def labels(self) -> tuple[str, ...]:
        """Labels of the channels in a figure, with units."""
        return tuple(LABELS[name] for name in self.names[:3])

    @property
    def duration_s(self) -> float:
        """How long it is."""
        return self.seen.shape[1] * STEP_S


class _Samples:
    """A vehicle's values with the time at which each passed the ground station, s."""

    def __init__(self) -> None:
        self.seen: tuple[str, str, str, str] = SEEN
        """Names of the quantities that follow the setpoints of speed, heading and height, and of the climb rate."""
        self.of: dict[str, list[tuple[float, float]]] = {}

    def add(self, at_s: float, values: Mapping[str, float]) -> None:
        for name, value in values.items():
            self.of.setdefault(name, []).append((at_s, value))


def recordings(log: Path, delays_s: Mapping[int, float] | None = None) -> list[Recording]:
    """Return the recording of each vehicle that flew under setpoints, from a .tlog or an ArduPilot log (.bin), by id.

    Args:
        log: the file.
        delays_s: round-trip delay of each system's link.

    Raises:
        RecordError: the log can't be read, or no vehicle flew under setpoints for `LEAST_S`.
    """
    try:
        require_file(log)
        vehicles = _of_dataflash(log) if log.suffix.lower() == DATAFLASH else _of_telemetry(log)
    except OSError as error:
        raise RecordError(f"{log}: {error.strerror or error}") from error
    except ValueError as error:
        raise RecordError(f"{log}: found {error}; allowed: a log as ArduPilot writes it") from error
    delays, wait_s = delays_s or {}, 0.0 if log.suffix.lower() == DATAFLASH else CYCLE_S / 2
    found = [_gridded(system, each, delays.get(system, 0.0), wait_s) for system, each in sorted(vehicles.items())]
    kept = [each for each in found if each is not None]
    if not kept:
        wanted = _of_dataflash_wanted(vehicles) if log.suffix.lower() == DATAFLASH else _of_telemetry_wanted()
        raise RecordError(f"{log}: found no vehicle under setpoints {wanted}")
    return kept


def _of_telemetry_wanted() -> str:
    wanted = f"{LEAST_S:.0f} s or more of a vehicle that is told speed, heading and height, and sends how it flies"
    return f"(commands 43000 to 43002, DO_REPOSITION, or velocities); allowed: {wanted}"


def _of_dataflash_wanted(vehicles: Mapping[int, _Samples]) -> str:
    """Return in words what an ArduPilot log lacks, by the names of its messages, and what one must have."""
    has = {name for each in vehicles.values() for name in each.of}
    lacks = [kind for kind, fields in DATAFLASH_FIELDS.items() if fields[0][0] not in has]
    found = f"(no messages {', '.join(lacks)})" if lacks else f"for {LEAST_S:.0f} s"
    kinds = ", ".join(list(DATAFLASH_FIELDS)[1:])
    return f"{found}; allowed: {LEAST_S:.0f} s or more of ArduPlane in GUIDED: OFG (its setpoints), {kinds}"


def _of_telemetry(log: Path) -> dict[int, _Samples]:
    vehicles, parser, begin_us = defaultdict[int, _Samples](_Samples), StreamParser(), None
    for time_us, raw in read_tlog(log):
        begin_us = time_us if begin_us is None else begin_us
        for frame in parser.feed(raw):
            _take(vehicles, (time_us - begin_us) * 1e-6, frame)
    return vehicles


def _of_dataflash(log: Path) -> dict[int, _Samples]:
    """Read ArduPlane's own log: setpoints as it took them (OFG), and how it flew."""
    samples, system = _Samples(), 1
    for kind, fields in m.dataflash_messages(str(log), ("PARM", *DATAFLASH_FIELDS)):
        try:
            if kind == "PARM":
                system = int(fields["Value"]) if fields["Name"] in SYSTEM_PARAMETERS else system
                continue
            values = {name: scale * float(fields[key]) for name, key, scale in DATAFLASH_FIELDS[kind]}
            samples.add(float(fields["TimeUS"]) * 1e-6, values)
        except KeyError as error:
            raise ValueError(f"a message {kind} without {error}") from error
    return {system: samples}


def _take(vehicles: defaultdict[int, _Samples], at_s: float, frame: Frame) -> None:
    match frame.message:
        case CommandInt(target_system=system, command=command, param2=value, z=height_m) if command in COMMANDS:
            values = {"speed": value, "heading": math.radians(value), "height": height_m}
            vehicles[system].add(at_s, {COMMANDS[command]: values[COMMANDS[command]]})
            if command == m.MAV_CMD_GUIDED_CHANGE_HEADING:
                vehicles[system].add(at_s, {"lateral": frame.message.param3})
        case CommandInt(command=m.MAV_CMD_DO_REPOSITION) as place:
            _take_place(vehicles[place.target_system], at_s, place)
        case SetPositionTargetLocalNed() as velocity:
            _take_velocity(vehicles[velocity.target_system], at_s, velocity)
        case VfrHud(airspeed_mps=airspeed):
            vehicles[frame.system].add(at_s, {"airspeed": airspeed})
        case Attitude(yaw_rad=yaw):
            vehicles[frame.system].add(at_s, {"yaw": yaw})
        case GlobalPositionInt(vx_mps=north, vy_mps=east) as seen:
            values = {"alt": seen.alt_m, "climb": -seen.vz_mps, "speed seen": math.hypot(north, east)}
            values |= {"course": math.atan2(east, north), "lat": seen.lat_rad, "lon": seen.lon_rad}
            vehicles[frame.system].add(at_s, values)
        case _:
            pass


def _take_place(samples: _Samples, at_s: float, place: CommandInt) -> None:
    """Take airspeed, course and height from a command that sends a fixed wing to a place ahead."""
    flies = place.param1 > 0.0  # 0 or less: the usual speed, at the formation's end
    if flies and "lat" in samples.of:
        samples.seen = SENT_TO_PLACES_SEEN
        (_, lat_rad), (_, lon_rad) = samples.of["lat"][-1], samples.of["lon"][-1]
        north_rad, east_rad = math.radians(place.x * 1e-7) - lat_rad, math.radians(place.y * 1e-7) - lon_rad
        course_rad = math.atan2(east_rad * math.cos(lat_rad), north_rad)
        samples.add(at_s, {"speed": place.param1, "heading": course_rad, "height": place.z})


def _take_velocity(samples: _Samples, at_s: float, velocity: SetPositionTargetLocalNed) -> None:
    """Take a multirotor's commanded velocity; its height setpoint is where the vertical velocity leads."""
    samples.seen = HOVERING_SEEN
    if "alt" in samples.of:
        north, east, height_m = velocity.vx_mps, velocity.vy_mps, samples.of["alt"][-1][1] - HEIGHT_S * velocity.vz_mps
        samples.add(at_s, {"speed": math.hypot(north, east), "heading": math.atan2(east, north), "height": height_m})


def _gridded(system: int, samples: _Samples, delay_s: float, wait_s: float) -> Recording | None:
    """Return the longest stretch without gaps, with setpoints taken `wait_s` late; None if it is too short."""
    names = samples.seen
    if any(len(samples.of.get(name, ())) < 2 for name in (*CHANNELS, *names)):
        return None
    every = {name: np.array(samples.of[name]) for name in (*CHANNELS, *names)}
    begin, end = (pick(each[at, 0] for each in every.values()) for pick, at in ((max, 0), (min, -1)))
    at_s = np.arange(begin, end, STEP_S)
    if at_s.size < 2:
        return None
    for angle in ("heading", names[1]):
        every[angle][:, 1] = np.unwrap(every[angle][:, 1])
    commanded = np.array([_held(every[name], at_s - wait_s) for name in CHANNELS])
    seen: Array = np.array([np.interp(at_s, every[name][:, 0], every[name][:, 1]) for name in names])
    limits_s = {name: SETPOINT_SILENT_S if name in CHANNELS else SILENT_S for name in every}
    fresh = np.all([at_s - _newest_s(each, at_s) < limits_s[name] for name, each in every.items()], axis=0)
    fresh[: round(SETTLING_S / STEP_S)] = False
    if names == HOVERING_SEEN:
        fresh &= np.minimum(commanded[0], seen[0]) > MOVES_MPS
    stretch = _longest(fresh)
    if (stretch.stop - stretch.start) * STEP_S < LEAST_S:
        return None
    commanded, seen = commanded[:, stretch], seen[:, stretch]
    commanded[1] += 2 * np.pi * np.round(np.median(seen[1] - commanded[1]) / (2 * np.pi))
    turning = np.array(samples.of.get("lateral", [(begin, FREELY_MPS2)]))
    lateral_mps2 = _held(turning, at_s - wait_s)[stretch]
    measured = tuple(_within(every[name], at_s[stretch]) for name in names[:3])
    return Recording(system, seen, commanded, delay_s, names, lateral_mps2, measured)


def _within(samples: Array, at_s: Array) -> tuple[Array, Array]:
    """Return the times of samples within a time grid, in its steps, and their values."""
    steps = (samples[:, 0] - at_s[0]) / STEP_S
    inside = (steps >= 0.0) & (steps <= len(at_s) - 1.0)
    return steps[inside], samples[inside, 1]


def _newest_s(samples: Array, at_s: Array) -> Array:
    """Return the time of the newest sample at each moment, (K,)."""
    return samples[np.maximum(np.searchsorted(samples[:, 0], at_s, side="right") - 1, 0), 0]


def _held(samples: Array, at_s: Array) -> Array:
    """Return the mean over the step after each moment (K,) of a value that is held until the next sample."""
    ends_s = np.append(samples[1:, 0], max(samples[-1, 0], at_s[-1]) + 2 * STEP_S)
    first = samples[0, 1]
    summed = np.concatenate(([0.0], np.cumsum((samples[:, 1] - first) * (ends_s - samples[:, 0]))))
    begin, end = (np.interp(each, np.append(samples[:, 0], ends_s[-1]), summed) for each in (at_s, at_s + STEP_S))
    return first + (end - begin) / STEP_S


def _longest(flags: Array) -> slice:
    """Return the longest run of True."""
    borders = np.flatnonzero(np.diff(np.concatenate(([0], flags.astype(np.int8), [0]))))
    runs = [slice(int(begin), int(end)) for begin, end in borders.reshape(-1, 2)]
    return max(runs, key=lambda run: run.stop - run.start, default=slice(0, 0))
