"""What bytes that are no frame cost a parser, beside pymavlink on the same bytes; compare their ratio."""

from __future__ import annotations

import os
import random
import time
from collections.abc import Callable

os.environ["MAVLINK20"] = "1"

from pymavlink.dialects.v20 import ardupilotmega as peer

from airlink.frame import FrameWriter
from airlink.messages.telemetry import Attitude
from airlink.stream_parser import MAX_REFUSED, StreamParser
from gcs_formation.studies.markdown import markdown

SIZE = 1400
"""Bytes of a datagram: as many as Ethernet carries, less headers."""
DATAGRAMS = 100
ROUNDS = 7


def garbage() -> dict[str, bytes]:
    """Return a datagram of each kind that makes a parser work hard."""
    noise = random.Random(1)
    frame = FrameWriter(1, 1).encode(Attitude(12.5, 0.1, 0.02, 0.14, 0.0, 0.01, 0.03))
    broken = frame[:-1] + bytes([frame[-1] ^ 1])
    parts = {
        "0x00": b"\0",
        "0xFE": b"\xfe",
        "0xFD": b"\xfd",
        "0xFE, 0xFD": b"\xfe\xfd",
        "0xFE, a length": b"\xfe\x1c",
        "headers of known messages, MAVLink 1": b"\xfe\x1c\x00\x01\x01\x1e",
        "headers of known messages, MAVLink 2": b"\xfd\xff\x00\x00\x00\x01\x01\x1e\x00\x00",
        "frames with wrong checksums": broken,
        "beginnings of frames": frame[:12],
    }
    whole = {name: (part * SIZE)[:SIZE] for name, part in parts.items()}
    return whole | {"random": noise.randbytes(SIZE), "random markers": bytes(noise.choices(b"\xfd\xfe", k=SIZE))}


def cost_us(take: Callable[[bytes], object], datagram: bytes) -> float:
    """Return the time for a datagram in the fastest of several rounds, µs."""
    fastest_s = float("inf")
    for _ in range(ROUNDS):
        began = time.perf_counter()  # the quantity measured
        for _ in range(DATAGRAMS):
            take(datagram)
        fastest_s = min(fastest_s, time.perf_counter() - began)
    return fastest_s / DATAGRAMS * 1e6


def main() -> None:
    """Measure and print the table."""
    rows = list[list[str]]()
    for name, datagram in garbage().items():
        other = peer.MAVLink(None)
        other.robust_parsing = True
        own_us, other_us = cost_us(StreamParser(MAX_REFUSED).feed, datagram), cost_us(other.parse_buffer, datagram)
        rows.append([name, f"{own_us:.0f}", f"{other_us:.0f}", f"{own_us / other_us:.3f}"])
    print(markdown((f"{SIZE} bytes of", "airlink, µs", "pymavlink, µs", "ratio, airlink to pymavlink"), rows))


if __name__ == "__main__":
    main()
