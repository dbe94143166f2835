"""Differences between the records of two revisions, and a tlog's frames read independently of the product."""

from __future__ import annotations

from collections.abc import Iterator
from pathlib import Path

from gcs_formation.diff.runs import differences

TLOG = "flight.tlog"
STAMP_BYTES = 8
"""Before each frame of a tlog: microseconds since 1970, big-endian."""
MARKER_V2 = 0xFD
OF_THE_REVISION = ("version", "features", "run.yaml")
"""What revisions may differ by when their flights are the same."""


def difference(base: Path, head: Path) -> str | None:
    """Return the first difference between two run directories, with its file and place; None if there's none."""
    texts = map(str, differences(base, head))
    return next((text for text in texts if not text.startswith(OF_THE_REVISION)), None)


def stamped_frames(tlog: Path) -> Iterator[tuple[int, bytes]]:
    """Yield each frame of a tlog with its stamp, µs since 1970.

    The lengths are those of the MAVLink guide, "Packet Serialization": 12 bytes about a payload of version 2 and
    13 more where it is signed, 8 about one of version 1.
    """
    log, at = tlog.read_bytes(), 0
    while at + STAMP_BYTES + 3 <= len(log):
        frame = log[at + STAMP_BYTES :][: 12 + 255 + 13]
        length = frame[1] + (12 + 13 * (frame[2] & 1) if frame[0] == MARKER_V2 else 8)
        yield int.from_bytes(log[at : at + STAMP_BYTES]), frame[:length]
        at += STAMP_BYTES + length
