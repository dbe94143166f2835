"""Frames per second that airlink encodes and decodes, beside pymavlink in the same run; compare their ratio."""

from __future__ import annotations

import os
import time
from collections.abc import Callable, Sized

os.environ["MAVLINK20"] = "1"

from pymavlink.dialects.v20 import ardupilotmega as peer

from airlink.frame import FrameWriter
from airlink.messages.telemetry import Attitude, GlobalPositionInt
from airlink.stream_parser import StreamParser
from gcs_formation.studies.markdown import markdown

FRAMES = 20_000
ROUNDS = 5


def frames() -> list[bytes]:
    """Return the two most frequent messages of a flight, alternating, as frames."""
    writer = FrameWriter(1, 1)
    position = GlobalPositionInt(12.5, 0.61, 2.18, 130.0, 130.0, 21.0, 3.0, -0.4, 0.14)
    attitude = Attitude(12.5, 0.1, 0.02, 0.14, 0.0, 0.01, 0.03)
    return [writer.encode(attitude if number % 2 else position) for number in range(FRAMES)]


def pymavlink_encode() -> None:
    """Encode the same with pymavlink."""
    link = peer.MAVLink(None, 1, 1)
    for number in range(FRAMES):
        if number % 2:
            message = peer.MAVLink_attitude_message(12500, 0.1, 0.02, 0.14, 0.0, 0.01, 0.03)
        else:
            message = peer.MAVLink_global_position_int_message(
                12500, 349504254, 1249047995, 130000, 130000, 2100, 300, -40, 802
            )
        message.pack(link)
        link.seq = (link.seq + 1) % 256


def decode(raw: list[bytes], take: Callable[[bytes], Sized | None]) -> None:
    """Decode one frame per datagram."""
    found = sum(len(take(datagram) or ()) for datagram in raw)
    if found != FRAMES:
        raise RuntimeError(f"found {found} frames of {FRAMES}")


def rate(work: Callable[[], object]) -> float:
    """Return frames per second in the fastest of several rounds."""
    fastest_s = float("inf")
    for _ in range(ROUNDS):
        began = time.perf_counter()  # the quantity measured
        work()
        fastest_s = min(fastest_s, time.perf_counter() - began)
    return FRAMES / fastest_s


def main() -> None:
    """Measure and print the table."""
    raw = frames()
    pairs = {
        "encode": (rate(frames), rate(pymavlink_encode)),
        "decode": (
            rate(lambda: decode(raw, StreamParser().feed)),
            rate(lambda: decode(raw, peer.MAVLink(None).parse_buffer)),
        ),
    }
    rows = [
        [what, f"{own / 1e3:.0f}", f"{other / 1e3:.0f}", f"{own / other:.2f}"] for what, (own, other) in pairs.items()
    ]
    print(markdown(("", "airlink, 1000 frames/s", "pymavlink, 1000 frames/s", "ratio, airlink to pymavlink"), rows))


if __name__ == "__main__":
    main()
