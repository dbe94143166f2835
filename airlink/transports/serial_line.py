"""A serial line: a telemetry radio, a cable, or a pseudo-terminal; it may be unplugged and plugged in again."""

from __future__ import annotations

import os
import selectors
from typing import Final

import serial

from airlink.endpoint import FAR_END, Address, Endpoint, PortError
from airlink.engine import Datagram
from airlink.transports.backlog import Backlog
from airlink.transports.transport import Transport

READ_BYTES: Final = 4096
BITS: Final = 10
"""On the line for each byte: start and stop bit included."""
WAIT_S: Final = 0.25
MIN_BACKLOG_BYTES: Final = 600
"""What waits for the line is at most as old as the first, and at least two of the longest frames."""
RETRY_NS: Final = 1_000_000_000
HINT: Final = "serial:DEVICE:BAUD, beside fly"


class SerialLine(Transport):
    """A serial device, with 8 data bits, no parity and 1 stop bit."""

    def __init__(self, endpoint: Endpoint) -> None:
        """Open it.

        Raises:
            PortError: there is no such device, it is in use, or it doesn't take the baud rate.
        """
        if endpoint.address.host.startswith(FAR_END):
            raise PortError(
                f"cannot open {endpoint}: found no device for it; allowed: sim-vehicles --endpoint ID={HINT}"
            )
        self._device, self._baud, self._peer = endpoint.address.host, endpoint.address.port, endpoint.far_end
        self._selector: selectors.BaseSelector | None = None
        self._index, self._next_ns = 0, 0
        self._backlog = Backlog(max(MIN_BACKLOG_BYTES, int(WAIT_S * self._baud / BITS)))
        try:
            self._line: serial.Serial | None = self._open()
        except (serial.SerialException, ValueError, OSError) as error:
            raise PortError(f"cannot open {endpoint}: {error}") from error

    def _open(self) -> serial.Serial:
        return serial.Serial(self._device, self._baud, timeout=0, write_timeout=0, exclusive=True)

    def register(self, selector: selectors.BaseSelector, index: int) -> None:
        """Let the selector wait for bytes whenever the device is there."""
        self._selector, self._index = selector, index
        if self._line is not None:
            selector.register(self._line.fileno(), selectors.EVENT_READ, index)

    def drain(self, index: int, max_datagrams: int) -> list[Datagram]:  # noqa: ARG002 - a stream has no datagrams to count
        """Return the bytes that have arrived."""
        if self._line is None:
            return []
        try:
            data = os.read(self._line.fileno(), READ_BYTES)
        except BlockingIOError:
            return []
        except OSError:
            data = b""
        if not data:
            self._lose(self._line)
            return []
        return [Datagram(index, self._peer, data)]

    def send(self, data: bytes, peer: Address) -> None:  # noqa: ARG002 - there is one
        """Send, or keep until the line has room."""
        if self._line is not None:
            self._backlog.add(data)
            self._backlog.flush(self._write)

    def _write(self, data: bytes) -> int:
        if self._line is None:
            return 0
        try:
            return os.write(self._line.fileno(), data)
        except BlockingIOError:
            return 0
        except OSError:
            self._lose(self._line)
            return 0

    def _lose(self, line: serial.Serial) -> None:
        """Close a device that has gone."""
        if self._selector is not None:
            self._selector.unregister(line.fileno())
        line.close()
        self._line = None
        self._backlog.clear()

    def maintain(self, now_ns: int) -> None:
        """Send what waits for the line; open a device that had gone once it is back."""
        if self._line is not None:
            self._backlog.flush(self._write)
        elif now_ns >= self._next_ns:
            self._next_ns = now_ns + RETRY_NS
            try:
                self._line = self._open()
            except (serial.SerialException, OSError):
                return
            if self._selector is not None:
                self._selector.register(self._line.fileno(), selectors.EVENT_READ, self._index)

    def close(self) -> None:
        """Close the device."""
        if self._line is not None:
            self._line.close()
