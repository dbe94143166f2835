"""What a stranger's flood costs a flight in real time: the same flight with and without it, one after the other.

A process of its own sends datagrams that are no frame to the port at which the station receives from its vehicles.
Processor time is the station's along the path, as the kernel accounts it; on a busy machine compare the flights with
each other. A tick is late when it starts more than 10 ms after it was due.
"""

from __future__ import annotations

import socket
import time
from concurrent.futures import ProcessPoolExecutor
from multiprocessing import get_context
from multiprocessing.synchronize import Event
from pathlib import Path
from typing import Any

import gcs_formation
from benchmarks import parser, print_load, which_package
from benchmarks.garbage import garbage
from benchmarks.real_time import along_the_path
from benchmarks.scale import scenario
from gcs_formation.studies.markdown import markdown

COUNT = 4
DURATION_S = 40.0
RATE_HZ = 4500.0
PORT = 21900
EVERY_S = 0.01
"""Interval of the flood's bursts."""
KINDS = "0xFE", "headers of known messages, MAVLink 2", "random"
HEAD = ("flood of", "a second", "processor time of the station, ms/s", "ticks", "late", "bytes never read, MB")


def send(data: bytes, rate_hz: float, over: Event) -> None:
    """Send datagrams at a rate until it's over; run it in a process of its own."""
    with socket.socket(socket.AF_INET, socket.SOCK_DGRAM) as stranger:
        due, each = time.monotonic(), round(rate_hz * EVERY_S)
        while not over.is_set():
            for _ in range(each):
                stranger.sendto(data, ("127.0.0.1", PORT))
            due += EVERY_S
            time.sleep(max(0.0, due - time.monotonic()))


def row(name: str, data: bytes, rate_hz: float) -> list[str]:
    """Fly in such a flood, and return its row of the table."""
    context = get_context("spawn")
    over = context.Event()
    flood = context.Process(target=send, args=(data, rate_hz, over))
    with ProcessPoolExecutor(1, mp_context=context) as pool:
        flood.start()
        try:
            spent_s, _, figures = along_the_path(pool, COUNT, DURATION_S, fly)
        finally:
            over.set()
            flood.join()
    control, unread = figures["control"], figures["received"]["unread_bytes"]
    spent_ms = 1e3 * spent_s / DURATION_S
    return [
        name,
        f"{rate_hz:.0f}",
        f"{spent_ms:.0f}",
        *(str(control[each]) for each in ("ticks", "late_ticks")),
        f"{unread / 1e6:.0f}",
    ]


def fly(count: int, duration_s: float, run_dir: Path) -> dict[str, Any]:
    """Fly with all vehicles at one port, and return the summary; run it in a process of its own."""
    keys = scenario(count, duration_s)
    for vehicle in keys["vehicles"]:
        vehicle["endpoint"] = f"udpin:127.0.0.1:{PORT}"
    return gcs_formation.run(keys, clock="real", out=run_dir).to_dict()


def main() -> None:
    """Fly without a flood, in one of each kind, and without again; print the table."""
    parser(__doc__).parse_args()
    of = garbage()
    rows = [row("nothing", b"", 0.0), *(row(name, of[name], RATE_HZ) for name in KINDS), row("nothing", b"", 0.0)]
    print(markdown(HEAD, rows))
    print(f"\n{which_package()}")
    print_load()


if __name__ == "__main__":
    main()
