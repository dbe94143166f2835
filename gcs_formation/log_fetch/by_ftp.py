"""The transfer of one vehicle's log by MAVLink FTP, where LOG_REQUEST_LIST isn't answered or says that there is none.

Source: MAVLink guide, "File Transfer Protocol (FTP)". A few reads at a time are under way: an ArduPilot's queue holds
five.
"""

from __future__ import annotations

import struct
from collections.abc import Callable
from typing import Final

from airlink import mavlink as m
from airlink.clock import Instant, after, seconds_between
from airlink.messages import Message
from airlink.messages.command import FileTransferProtocol, LogEntry
from gcs_formation.log_fetch.log_folders import LogFolders
from gcs_formation.log_fetch.transfer import PATIENCE_S, Stage

TERMINATE, LIST, OPEN, READ, ACK, NAK = 1, 3, 4, 5, 128, 129
END_OF_FILE: Final = 6
HEADER: Final = struct.Struct("<HBBBBBBI")
MAX_DATA: Final = 239
PAYLOAD: Final = 251
AT_ONCE: Final = 4
RETRY_S: Final = 0.5


class FtpTransfer:
    """Fetches the newest log of a vehicle, or the one of a number, as `LogTransfer` does."""

    def __init__(
        self, system: int, folders: LogFolders, number: int | None, now: Instant, kept: Callable[[LogEntry], int]
    ) -> None:
        """Begin to fetch; `folders`: where its family keeps logs; `kept`: how many bytes of a log are there."""
        self._system, self._wanted, self._kept = system, number, kept
        self.stage, self.failure, self.received = Stage.LISTING, "", 0
        self.entry: LogEntry | None = None
        self._folders = folders
        self._session, self._sequence, self._closing = -1, 0, False
        self._ready, self._ahead = list[bytes](), dict[int, bytes]()
        self._asked = dict[int, Instant]()
        """Reads under way, by their offsets."""
        self._progress = self._next = now

    @property
    def over(self) -> bool:
        """Whether it has come to an end."""
        return self.stage in (Stage.DONE, Stage.FAILED)

    def chunks(self) -> list[bytes]:
        """Remove and return what has come without a gap, in order."""
        ready, self._ready = self._ready, []
        return ready

    def requests(self, now: Instant) -> list[Message]:
        """Return what to send now."""
        if self._closing:
            self._closing = False
            return [self._packet(TERMINATE)]
        if not self.over and seconds_between(self._progress, now) > PATIENCE_S:
            self._end(f"nothing came by MAVLink FTP for {PATIENCE_S:g} s while {self.stage.value}")
        if self.over:
            return []
        return self._reads(now) if self._session >= 0 else self._begins(now)

    def _begins(self, now: Instant) -> list[Message]:
        """Return the request that lists the folder, or opens the log."""
        if now < self._next:
            return []
        self._next = after(now, RETRY_S)
        if self.entry is None:
            return [self._packet(LIST, self._folders.path.encode(), self._folders.seen)]
        return [self._packet(OPEN, self._folders.file(self.entry.id).encode())]

    def _reads(self, now: Instant) -> list[Message]:
        assert self.entry is not None, "there is one while reading"
        found = list[Message]()
        for index in range(AT_ONCE):
            offset = self.received + index * MAX_DATA
            late = seconds_between(self._asked.get(offset, Instant(0)), now) > RETRY_S
            if offset < self.entry.size and offset not in self._ahead and (offset not in self._asked or late):
                self._asked[offset] = now
                found.append(self._packet(READ, b"", offset, size=MAX_DATA))
        return found

    def _packet(self, opcode: int, data: bytes = b"", offset: int = 0, size: int | None = None) -> Message:
        self._sequence = (self._sequence + 1) % 2**16
        head = self._sequence, max(self._session, 0), opcode, len(data) if size is None else size, 0, 0, 0, offset
        payload = (HEADER.pack(*head) + data).ljust(PAYLOAD, b"\0")
        return FileTransferProtocol(0, self._system, m.MAV_COMP_ID_AUTOPILOT1, tuple(payload))

    def take(self, message: Message, now: Instant) -> None:
        """Take a message of the vehicle."""
        if not isinstance(message, FileTransferProtocol) or self.over:
            return
        payload = bytes(message.payload).ljust(PAYLOAD, b"\0")
        _, session, opcode, size, asked, _, _, offset = HEADER.unpack_from(payload)
        data = payload[HEADER.size : HEADER.size + min(size, MAX_DATA)]
        if opcode not in (ACK, NAK):
            return
        if asked == LIST and self.entry is None:
            self._progress, self._next = now, Instant(0)
            self._take_list(data if opcode == ACK else b"", more=opcode == ACK)
        elif asked == OPEN and self._session < 0 and self.entry is not None:
            self._open(session, opcode == ACK)
        elif asked == READ and self._session >= 0:
            self._progress = now
            self._store(offset, data, read=opcode == ACK)

    def _take_list(self, data: bytes, *, more: bool) -> None:
        """Take entries of a folder, until it says that there are no more."""
        entries = [each for each in data.decode("utf-8", "replace").split("\0") if each]
        self._folders.add(entries)
        if (more and entries) or self._folders.descends():
            return
        sizes = self._folders.sizes
        number = self._wanted if self._wanted is not None else max(sizes, default=-1)
        if number in sizes:
            self.entry = LogEntry(number, len(sizes), max(sizes), 0, sizes[number])
            self.stage, self.received = Stage.FETCHING, self._kept(self.entry)
            if self.received >= self.entry.size:
                self.stage = Stage.DONE
        elif not self._folders.goes_on():
            known = ", ".join(str(each) for each in sorted(sizes))
            self._end(f"found no log {self._wanted}; allowed: {known}" if known else "it has no logs")

    def _open(self, session: int, granted: bool) -> None:
        if granted:
            self._session = session
        else:
            self._end("it doesn't open its log by MAVLink FTP")

    def _store(self, offset: int, data: bytes, *, read: bool) -> None:
        """Keep what was read, and pass on what follows without a gap."""
        assert self.entry is not None, "there is one while reading"
        if read and data and offset >= self.received:
            self._ahead[offset] = data
        while (part := self._ahead.pop(self.received, None)) is not None:
            self._asked.pop(self.received, None)
            self._ready.append(part)
            self.received += len(part)
        ended = not read and offset <= self.received
        if self.received >= self.entry.size or ended:
            self.stage, self._closing = Stage.DONE, True

    def _end(self, why: str) -> None:
        self.stage, self.failure, self._closing = Stage.FAILED, why, self._session >= 0
