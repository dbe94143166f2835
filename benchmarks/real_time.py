"""Processor time of the ground station in real time, over UDP, beside a mavutil loop with the same traffic.

Beside both, what the sockets alone cost: the same datagrams received and sent in batches, and never looked at.

The emulated vehicles are a process of their own, and each has a port of its own. The mavutil loop waits for all sockets
at once, keeps the newest of each message, and sends setpoints like the one of `prototype`: it has no law, no clocks and
no record. Ours has everything on and is recorded. Start and end don't count: of ours only processor time along the
path, as the kernel accounts it. A tick is late when it starts more than 10 ms after it was due.
"""

from __future__ import annotations

import os
import selectors
import subprocess
import sys
import tempfile
import time
from collections.abc import Callable
from concurrent.futures import ProcessPoolExecutor
from multiprocessing import get_context
from pathlib import Path
from typing import Any

os.environ["MAVLINK20"] = "1"

import yaml

import gcs_formation
from airlink.transports.udp import Inbox
from benchmarks import parser, print_load
from benchmarks.prototype import E7, setpoints
from benchmarks.scale import scenario
from gcs_formation.studies.markdown import markdown

COUNTS = (4, 100, 250)
DURATION_S = 20.0
FIRST_PORT = 21000
PERIOD_S = 0.1
SETTLE_S = 5.0
SENT_EACH_TICK, SENT_EACH_SECOND = 1, 9
"""Datagrams that the sockets alone send to a vehicle, 18 a second as the station does."""
MARGIN_S = 2.0
"""Time along the path before and after the measurement."""
STREAMS = ("GLOBAL_POSITION_INT", "ATTITUDE", "VFR_HUD")
HEAD = (
    "vehicles",
    "mavutil, µs a vehicle and s",
    "its frames a vehicle and s",
    "ours, µs",
    "our frames",
    "share",
    "sockets alone, µs",
    "share",
    "ticks",
    "late",
)


Fly = Callable[[int, float, Path], dict[str, Any]]
"""Flies so many vehicles for some seconds, recorded in a run directory."""


def planned(count: int, duration_s: float) -> dict[str, Any]:
    """Return the scenario, with a port for each vehicle."""
    keys = scenario(count, duration_s)
    for index, vehicle in enumerate(keys["vehicles"]):
        vehicle["endpoint"] = f"udpin:127.0.0.1:{FIRST_PORT + index}"
    return keys


def fly(count: int, duration_s: float, run_dir: Path) -> dict[str, Any]:
    """Fly, and return the figures of `control`; run it in a process of its own."""
    return gcs_formation.run(planned(count, duration_s), clock="real", out=run_dir).to_dict()["control"]


def along_the_path(
    pool: ProcessPoolExecutor, count: int, duration_s: float, fly: Fly
) -> tuple[float, int, dict[str, Any]]:
    """Return processor time, s, of our ground station along the path, its frames, and what `fly` returns."""
    process = pool.submit(os.getpid).result()
    with tempfile.TemporaryDirectory() as out:
        run_dir = Path(out) / "run"
        flight = pool.submit(fly, count, duration_s + 2.0 * MARGIN_S, run_dir)
        while not flight.done() and not _flies(run_dir / "events.jsonl"):
            time.sleep(PERIOD_S)
        time.sleep(MARGIN_S)
        spent_s, frames = processor_s(process), datagrams()
        time.sleep(duration_s)
        spent_s, frames = processor_s(process) - spent_s, datagrams() - frames
        return spent_s, frames, flight.result()


def processor_s(process: int) -> float:
    """Return the processor time of a process, s: user and system time."""
    fields = Path(f"/proc/{process}/stat").read_text().rpartition(")")[2].split()
    return (int(fields[11]) + int(fields[12])) / os.sysconf("SC_CLK_TCK")


def datagrams() -> int:
    """Return how many UDP datagrams this machine has received; in a flight each carries one frame."""
    names, numbers = (line.split() for line in Path("/proc/net/snmp").read_text().splitlines() if line[:4] == "Udp:")
    return int(numbers[names.index("InDatagrams")])


def _flies(events: Path) -> bool:
    return events.is_file() and '"text": "flying"' in events.read_text()


class Loop:
    """The loop on mavutil."""

    def __init__(self, count: int) -> None:
        """Listen at every vehicle's port."""
        from pymavlink import mavutil  # noqa: PLC0415 - in a process of its own

        self._dialect: Any = mavutil.mavlink
        self._links: list[Any] = [
            mavutil.mavlink_connection(f"udpin:127.0.0.1:{FIRST_PORT + index}", source_system=255)
            for index in range(count)
        ]
        self._newest: list[dict[str, Any]] = [{} for _ in self._links]
        self._commanded: list[dict[int, float]] = [{} for _ in self._links]
        self._selector = selectors.DefaultSelector()
        for index, link in enumerate(self._links):
            self._selector.register(link.port, selectors.EVENT_READ, index)
        self.frames = 0

    def run(self, duration_s: float) -> float:
        """Receive and send for a time by the machine's clock, as a ground station does; return processor time, s."""
        began, due, ticks = time.process_time(), time.monotonic(), 0
        until = due + duration_s
        while (now := time.monotonic()) < until:
            for key, _ in self._selector.select(max(0.0, due - now)):
                self._take(key.data)
            if time.monotonic() >= due:
                due += PERIOD_S
                ticks += 1
                for index in range(len(self._links)):
                    self._tick(index, each_second=ticks % 10 == 0)
        return time.process_time() - began

    def request(self) -> None:
        """Ask each vehicle that was received for its state at 10 Hz."""
        for index, link in enumerate(self._links):
            for name in STREAMS if self._newest[index] else ():
                number = getattr(self._dialect, f"MAVLINK_MSG_ID_{name}")
                interval = self._dialect.MAV_CMD_SET_MESSAGE_INTERVAL
                link.mav.command_long_send(index + 1, 1, interval, 0, number, 1e6 * PERIOD_S, 0, 0, 0, 0, 0)

    def close(self) -> None:
        """Close the ports."""
        self._selector.close()
        for link in self._links:
            link.close()

    def _take(self, index: int) -> None:
        while (message := self._links[index].recv_match(blocking=False)) is not None:
            self._newest[index][message.get_type()] = message
            self.frames += 1

    def _tick(self, index: int, *, each_second: bool) -> None:
        position = self._newest[index].get("GLOBAL_POSITION_INT")
        if position is None:
            return
        link = self._links[index]
        for command, value in setpoints(self._commanded[index], (position.lon % 1e7) / E7, each_second=each_second):
            link.mav.command_int_send(index + 1, 1, 0, command, 0, 0, 1.0, value, 5.5, 0.0, 0, 0, value)
            self.frames += 1
        if each_second:
            link.mav.heartbeat_send(6, 8, 0, 0, 4)
            for _ in range(4):
                link.mav.timesync_send(0, time.monotonic_ns())
            link.mav.named_value_float_send(0, b"MISSION_T", 0.0)
            self.frames += 6


class SocketsAlone(Loop):
    """The loop without mavutil once it is `emptied`: it reads no datagram and sends the same bytes again."""

    def __init__(self, count: int) -> None:
        """Listen at every vehicle's port."""
        super().__init__(count)
        self._inbox, self._raw, self._peers = Inbox(), b"", list[tuple[str, int]]()

    def emptied(self) -> None:
        """From now on only move datagrams, to the vehicles that were received."""
        tell = self._dialect.MAVLink_command_int_message(1, 1, 0, 0, 0, 0, 1.0, 0.0, 5.5, 0.0, 0, 0, 0.0)
        self._raw = bytes(tell.pack(self._links[0].mav))
        self._peers = [next(iter(link.clients)) for link in self._links]

    def _take(self, index: int) -> None:
        if self._raw:
            self.frames += len(self._inbox.drain(self._links[index].port))
        else:
            super()._take(index)

    def _tick(self, index: int, *, each_second: bool) -> None:
        if not self._raw:
            super()._tick(index, each_second=each_second)
            return
        for _ in range(SENT_EACH_SECOND if each_second else SENT_EACH_TICK):
            self._links[index].port.sendto(self._raw, self._peers[index])
            self.frames += 1


def loop(kind: type[Loop], count: int, duration_s: float) -> tuple[float, int]:
    """Return processor time, s, and frames of a loop."""
    with tempfile.TemporaryDirectory() as directory:
        file = Path(directory) / "scenario.yaml"
        file.write_text(yaml.safe_dump(planned(count, duration_s)))
        listening = kind(count)
        vehicles = subprocess.Popen([sys.executable, "-P", "-m", "sim_vehicles", str(file)], stdout=subprocess.DEVNULL)
        try:
            listening.run(SETTLE_S + count / 50.0)
            listening.request()
            listening.run(SETTLE_S)
            if isinstance(listening, SocketsAlone):
                listening.emptied()
            before = listening.frames
            spent_s = listening.run(duration_s)
            return spent_s, listening.frames - before
        finally:
            listening.close()
            vehicles.terminate()
            vehicles.wait()


def measured(count: int, duration_s: float) -> list[str]:
    """Return a row of the table."""
    with ProcessPoolExecutor(1, mp_context=get_context("spawn")) as pool:
        theirs_s, their_frames = pool.submit(loop, Loop, count, duration_s).result()
        alone_s, _ = pool.submit(loop, SocketsAlone, count, duration_s).result()
        ours_s, our_frames, control = along_the_path(pool, count, duration_s, fly)
    each = count * duration_s
    theirs, ours, alone = (spent_s / each * 1e6 for spent_s in (theirs_s, ours_s, alone_s))
    figures = theirs, their_frames / each, ours, our_frames / each
    shares = f"1/{theirs / ours:.1f}", f"{alone:.0f}", f"1/{theirs / alone:.1f}"
    return [
        str(count),
        *(f"{figure:.0f}" for figure in figures),
        *shares,
        str(control["ticks"]),
        str(control["late_ticks"]),
    ]


def main() -> None:
    """Measure every size and print the table."""
    parsing = parser(__doc__, COUNTS)
    parsing.add_argument("--seconds", type=float, default=DURATION_S)
    given = parsing.parse_args()
    print(markdown(HEAD, [measured(count, given.seconds) for count in given.counts]))
    print_load()


if __name__ == "__main__":
    main()
