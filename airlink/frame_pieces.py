"""Cuts a stream of bytes into frames without reading them, so that what happens to a datagram happens to whole frames.

All bytes pass, in their order: also those between frames, and frames of unknown messages.
"""

from __future__ import annotations

import re
from typing import Final

from airlink.frame import frame_length

_find_marker: Final = re.compile(rb"[\xfd\xfe]").search


class Pieces:
    """One remote's stream."""

    def __init__(self) -> None:
        """Start with no bytes."""
        self._rest = b""

    def cut(self, data: bytes) -> list[bytes]:
        """Return the frames, and the bytes between them, that `data` completes."""
        data, found, at = self._rest + data, list[bytes](), 0
        while at < len(data):
            end = self._end(data, at)
            if end > len(data):
                break
            found.append(data[at:end])
            at = end
        self._rest = data[at:]
        return found

    @property
    def rest(self) -> bytes:
        """What isn't complete yet."""
        return self._rest

    @staticmethod
    def _end(data: bytes, at: int) -> int:
        """Return where what begins at an index ends; beyond the data if that isn't there yet."""
        length = frame_length(data, at)
        if length == 0:
            marker = _find_marker(data, at)
            return len(data) if marker is None else marker.start()
        return at + length  # of a signed frame too: it has its flags before it has its shortest length
