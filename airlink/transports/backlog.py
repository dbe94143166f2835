"""What a stream couldn't take yet: whole datagrams, or none of one, so that no frame is ever sent in part.

How much may wait: `serial_line.WAIT_S`, by the line's rate, and `tcp.BACKLOG_BYTES`.
"""

from __future__ import annotations

from collections import deque
from collections.abc import Callable


class Backlog:
    """Bytes that wait for room in a stream; of what doesn't fit any more, whole datagrams are lost."""

    def __init__(self, max_bytes: int) -> None:
        """Keep at most `max_bytes`, so that what is sent is never much older than that takes."""
        self._max_bytes, self._bytes = max_bytes, 0
        self._waiting = deque[bytes]()

    def clear(self) -> None:
        """Drop everything, as when the connection is lost."""
        self._waiting.clear()
        self._bytes = 0

    def add(self, data: bytes) -> None:
        """Append a datagram, unless too much is waiting."""
        if self._bytes + len(data) <= self._max_bytes:
            self._waiting.append(data)
            self._bytes += len(data)

    def flush(self, write: Callable[[bytes], int]) -> None:
        """Write what there is room for.

        Args:
            write: writes to the stream and returns how many bytes it took; 0 if there is no room.
        """
        while self._waiting:
            first = self._waiting.popleft()
            taken = write(first)
            self._bytes -= taken
            if taken < len(first):
                self._waiting.appendleft(first[taken:])
                return
