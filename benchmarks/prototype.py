"""Our flight beside a careful prototype in plain Python: pymavlink's messages with fastcrc, no law and no record.

The prototype exchanges as many messages in the same directions: telemetry at 10 Hz, setpoints and their
acknowledgements (again when they change by 0.005, and every second), heartbeats and slow telemetry once a second. Each
datagram is one frame, which it decodes at once instead of byte by byte. Its vehicles fly equation (7) without limits;
its ground station keeps the newest of each message, counts gaps and sends setpoints that depend on the position. Each
round measures both, one after the other, in processes of their own. Only the second half of a flight counts, so that
start and end don't.
"""

from __future__ import annotations

import math
import os
import sys
import time
from collections.abc import Callable, Iterator
from typing import Any

os.environ["MAVLINK20"] = "1"

from pymavlink.dialects.v20 import ardupilotmega as dialect

from benchmarks import alone, flown, parser, print_load
from benchmarks.scale import scenario
from gcs_formation.studies.markdown import markdown

COUNTS = (4, 100)
ROUNDS = 3
WARM_UP_S = 2.0
SHORTEST_S = 20.0
"""Shortest half flight that is measured: runs differ in the time of start and end, which must be small beside it."""
CYCLES = 50
"""Cycles of a vehicle's main loop per second."""
PERIOD = 5
"""Cycles between ticks."""
SPEED = dialect.MAV_CMD_GUIDED_CHANGE_SPEED
HEIGHT = dialect.MAV_CMD_GUIDED_CHANGE_ALTITUDE
HEADING = dialect.MAV_CMD_GUIDED_CHANGE_HEADING
RESOLUTION = 0.005
HEAD = ("vehicles,", "prototype, ms", "its frames,", "ours, ms", "our frames,", "times as fast,", "least and most,")
"""Milliseconds of processor time per simulated second; frames per vehicle and second; medians of the rounds."""
SLOW_DOWN, SLOW_UP = 15, 7
"""Messages from and to a vehicle per second besides telemetry, setpoints and answers: as in our flight."""
E7 = 1e7 / 6_378_137.0 * 180.0 / math.pi


class End:
    """One end of a link: encodes messages as frames, decodes frames, and counts gaps."""

    def __init__(self, system: int) -> None:
        self._link: Any = dialect.MAVLink(None, srcSystem=system, srcComponent=1)
        self._sequence, self.lost = -1, 0

    def encode(self, message: Any) -> bytes:  # noqa: ANN401 - pymavlink has no types
        """Return a frame."""
        raw: bytes = message.pack(self._link)
        self._link.seq = (self._link.seq + 1) & 0xFF
        return raw

    def decode(self, raw: bytes) -> Any:  # noqa: ANN401
        """Return a frame's message."""
        message = self._link.decode(bytearray(raw))
        sequence = message.get_seq()
        self.lost += (sequence - self._sequence - 1) & 0xFF if self._sequence >= 0 else 0
        self._sequence = sequence
        return message


class PrototypeVehicle:
    """Flies equation (7) in steps of 20 ms, sends its state, and acknowledges setpoints."""

    def __init__(self, system: int) -> None:
        self.end = End(system)
        self.north_m = -30.0 * system
        self.east_m, self.height_m, self.climb_mps, self.speed_mps, self.heading_rad = 0.0, 200.0, 0.0, 22.0, 0.0
        self.commanded_mps, self.commanded_rad, self.commanded_m = 22.0, 0.0, 200.0
        step_s = 1.0 / CYCLES
        self._kept = math.exp(-step_s / 4.0), math.exp(-step_s / 1.5)

    def fly(self) -> None:
        """Advance by a cycle."""
        step_s, (speed_kept, heading_kept) = 1.0 / CYCLES, self._kept
        self.speed_mps = self.commanded_mps + (self.speed_mps - self.commanded_mps) * speed_kept
        off_rad = (self.heading_rad - self.commanded_rad + math.pi) % math.tau - math.pi
        self.heading_rad = self.commanded_rad + off_rad * heading_kept
        self.climb_mps += step_s * ((self.commanded_m - self.height_m) / 3.0 - self.climb_mps * 4.0 / 3.0)
        self.height_m += self.climb_mps * step_s
        self.north_m += self.speed_mps * math.cos(self.heading_rad) * step_s
        self.east_m += self.speed_mps * math.sin(self.heading_rad) * step_s

    def tell(self, cycle: int) -> list[bytes]:
        """Return position, attitude and airspeed at each tick, and slow telemetry each second."""
        now_ms, cos, sin = cycle * 20, math.cos(self.heading_rad), math.sin(self.heading_rad)
        height_mm, speed = round(self.height_m * 1e3), self.speed_mps
        position = round(35e7 + self.north_m * E7), round(125e7 + self.east_m * E7)
        velocity = round(speed * cos * 100), round(speed * sin * 100), round(-self.climb_mps * 100)
        degrees = math.degrees(self.heading_rad) % 360.0
        messages = [
            dialect.MAVLink_global_position_int_message(
                now_ms, *position, height_mm, height_mm, *velocity, round(degrees * 100) % 36000
            ),
            dialect.MAVLink_attitude_message(now_ms, 0.0, 0.0, self.heading_rad, 0.0, 0.0, 0.0),
            dialect.MAVLink_vfr_hud_message(speed, speed, round(degrees) % 360, 50, self.height_m, self.climb_mps),
        ]
        if cycle % CYCLES == 0:
            messages += [dialect.MAVLink_heartbeat_message(1, 3, 217, 15, 4, 3) for _ in range(SLOW_DOWN)]
        return [self.end.encode(each) for each in messages]

    def take(self, raw: bytes) -> bytes | None:
        """Take a setpoint, and return its acknowledgement; None for anything else."""
        received = self.end.decode(raw)
        if received.get_msgId() != dialect.MAVLINK_MSG_ID_COMMAND_INT:
            return None
        if received.command == SPEED:
            self.commanded_mps = received.param2
        elif received.command == HEIGHT:
            self.commanded_m = received.z
        elif received.command == HEADING:
            self.commanded_rad = math.radians(received.param2)
        return self.end.encode(dialect.MAVLink_command_ack_message(received.command, 0, 0, 0, 255, 190))


class PrototypeStation:
    """Keeps the newest of each vehicle's messages, and sends it three setpoints, on changes and every second."""

    def __init__(self, count: int) -> None:
        self.ends = [End(255) for _ in range(count)]
        self.newest: list[dict[int, Any]] = [{} for _ in range(count)]
        self.received: list[dict[int, float]] = [{} for _ in range(count)]

    def take(self, index: int, raw: bytes) -> None:
        """Take a vehicle's frame."""
        message = self.ends[index].decode(raw)
        self.newest[index][message.get_msgId()] = message

    def tick(self, index: int, cycle: int) -> list[bytes]:
        """Return setpoints that lead a vehicle back to its line, speed and height, and slow messages each second."""
        position = self.newest[index][dialect.MAVLINK_MSG_ID_GLOBAL_POSITION_INT]
        east_m = (position.lon - 125e7) / E7
        each_second = cycle % CYCLES == 0
        due = setpoints(self.received[index], east_m, each_second=each_second)
        messages: list[Any] = [_command(index + 1, command, value) for command, value in due]
        if each_second:
            messages += [dialect.MAVLink_heartbeat_message(6, 8, 0, 0, 4, 3) for _ in range(SLOW_UP)]
        return [self.ends[index].encode(each) for each in messages]


def setpoints(received: dict[int, float], east_m: float, *, each_second: bool) -> Iterator[tuple[int, float]]:
    """Yield the commands that lead a vehicle back to its line, if they changed since they were sent."""
    degrees = math.degrees(-math.atan(east_m / 60.0)) % 360.0
    for command, value in ((SPEED, 22.0), (HEIGHT, 200.0), (HEADING, degrees)):
        if each_second or abs(value - received.get(command, math.inf)) > RESOLUTION:
            received[command] = value
            yield command, value


def _command(system: int, command: int, value: float) -> Any:  # noqa: ANN401
    return dialect.MAVLink_command_int_message(system, 1, 0, command, 0, 0, 1.0, value, 5.5, 0.0, 0, 0, value)


def fly_prototype(count: int, duration_s: float) -> tuple[float, int]:
    """Return processor time, s, and frames of a flight of the prototype."""
    vehicles, station, frames = [PrototypeVehicle(1 + index) for index in range(count)], PrototypeStation(count), 0
    began = time.process_time()
    for cycle in range(round(duration_s * CYCLES)):
        for index, vehicle in enumerate(vehicles):
            vehicle.fly()
            if cycle % PERIOD == 0:
                received = vehicle.tell(cycle)
                for raw in received:
                    station.take(index, raw)
                orders = station.tick(index, cycle)
                answers = [answer for raw in orders if (answer := vehicle.take(raw)) is not None]
                for raw in answers:
                    station.take(index, raw)
                frames += len(received) + len(orders) + len(answers)
    spent_s = time.process_time() - began
    if any(end.lost for end in station.ends) or abs(vehicles[-1].height_m - 200.0) > 1.0:
        raise RuntimeError("the prototype's own flight went wrong")
    return spent_s, frames


def fly_ours(count: int, duration_s: float) -> tuple[float, int]:
    """Return processor time, s, and frames of our flight: everything on, recorded."""
    began = time.process_time()
    with flown(scenario(count, duration_s)) as summary:
        spent_s = time.process_time() - began
    return spent_s, sum(each["frames_in"] + each["frames_out"] for each in summary.to_dict()["links"].values())


def rate(fly: Callable[[int, float], tuple[float, int]], count: int, duration_s: float) -> tuple[float, float]:
    """Return processor time (ms) and frames per simulated second, in the second half of a flight.

    A first, short flight loads the modules that flights need.
    """
    fly(count, WARM_UP_S)
    short_s, few = fly(count, duration_s)
    long_s, many = fly(count, 2.0 * duration_s)
    return (long_s - short_s) / duration_s * 1e3, (many - few) / duration_s / count


def main() -> None:
    """Fly both in turn and print the table."""
    parsing = parser(__doc__, COUNTS)
    parsing.add_argument("--rounds", type=int, default=ROUNDS)
    parsing.add_argument("--seconds", type=float, default=200.0, help="simulated, of four vehicles; fewer of more")
    given = parsing.parse_args()
    rows: list[list[str]] = []
    for count in given.counts:
        duration_s = max(SHORTEST_S, given.seconds * 4 / count)
        pairs = [
            [alone(rate, fly, count, duration_s) for fly in (fly_prototype, fly_ours)] for _ in range(given.rounds)
        ]
        ratios = sorted(theirs[0] / ours[0] for theirs, ours in pairs)
        theirs, ours = (sorted(pair[side] for pair in pairs)[len(pairs) // 2] for side in (0, 1))
        found = [f"{theirs[0]:.2f}", f"{theirs[1]:.0f}", f"{ours[0]:.2f}", f"{ours[1]:.0f}"]
        rows.append([str(count), *found, f"{ratios[len(ratios) // 2]:.2f}", f"{ratios[0]:.2f} to {ratios[-1]:.2f}"])
        print(f"{count} vehicles measured", file=sys.stderr)
    print(markdown(HEAD, rows))
    print_load()


if __name__ == "__main__":
    main()
