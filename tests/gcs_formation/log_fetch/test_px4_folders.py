"""Logs of a PX4 by MAVLink FTP: it keeps them in a folder a day, and lists them in no order."""

import struct

import pytest

from airlink.clock import Instant, after
from airlink.messages.command import FileTransferProtocol, LogEntry, LogRequestList
from gcs_formation.log_fetch.by_ftp import ACK, HEADER, LIST, NAK, OPEN, READ, FtpTransfer
from gcs_formation.log_fetch.log_folders import PX4, LogFolders
from gcs_formation.log_fetch.transfer import LogTransfer, Stage

CONTENT = bytes(range(256)) * 4
CARD = {
    "/fs/microsd/log": ["S", "Dsess012", "D2026-11-28", "D2026-11-29", "Fstray.txt\t4"],
    "/fs/microsd/log/2026-11-28": ["F23_59_59.ulg\t7"],
    "/fs/microsd/log/2026-11-29": ["S", "F08_00_01.ulg\t9", f"F17_05_02.ulg\t{len(CONTENT)}", "F10_00_00.ulg\t8"],
    "/fs/microsd/log/sess012": ["Flog100.ulg\t5"],
}
FILE = "/fs/microsd/log/2026-11-29/17_05_02.ulg"


class Card:
    """Answers as PX4's MAVLink FTP does: two entries of a folder at a time, then that there are no more."""

    def __init__(self, folders: dict[str, list[str]], file: str = FILE) -> None:
        self.folders, self.file, self.asked = folders, file, list[str]()

    def answer(self, request: FileTransferProtocol) -> FileTransferProtocol:
        sequence, _, opcode, size, _, _, _, offset = HEADER.unpack_from(bytes(request.payload))
        data = bytes(request.payload)[HEADER.size :]
        name, found = data.rstrip(b"\0").decode() if opcode in (LIST, OPEN) else "", b""
        if opcode == LIST:
            self.asked.append(name)
            found = b"".join(each.encode() + b"\0" for each in self.folders.get(name, [])[offset : offset + 2])
        elif opcode == OPEN and name == self.file:
            found = struct.pack("<I", len(CONTENT))
        elif opcode == READ:
            found = CONTENT[offset : offset + size]
        head = (sequence + 1, 0, ACK if found else NAK, len(found) or 1, opcode, 0, 0, offset)
        payload = (HEADER.pack(*head) + (found or b"\6")).ljust(len(request.payload), b"\0")
        return FileTransferProtocol(0, 255, 25, tuple(payload))


def fetched(card: Card) -> FtpTransfer:
    transfer, now = FtpTransfer(1, LogFolders(PX4), None, Instant(0), lambda _: 0), Instant(0)
    while not transfer.over:
        now = after(now, 0.05)
        for request in transfer.requests(now):
            assert isinstance(request, FileTransferProtocol)
            transfer.take(card.answer(request), now)
    return transfer


def test_the_newest_log_of_the_newest_day_comes_byte_for_byte() -> None:
    card = Card(CARD)
    transfer = fetched(card)
    assert (transfer.stage, b"".join(transfer.chunks())) == (Stage.DONE, CONTENT)
    assert transfer.entry is not None
    assert transfer.entry.id == 170502
    assert list(dict.fromkeys(card.asked)) == ["@MAV_LOG", "/fs/microsd/log", "/fs/microsd/log/2026-11-29"]


def test_where_the_time_is_not_known_logs_are_numbered_by_boots() -> None:
    folders = {"@MAV_LOG": ["Dsess099", "Dsess100"], "@MAV_LOG/sess100": [f"Flog102.ulg\t{len(CONTENT)}"]}
    transfer = fetched(Card(folders, "@MAV_LOG/sess100/log102.ulg"))
    assert transfer.stage is Stage.DONE
    assert transfer.entry is not None
    assert transfer.entry.id == 102


def test_a_card_without_logs_has_none() -> None:
    assert fetched(Card({"log": ["S", "S"]})).failure == "it has no logs"


@pytest.mark.parametrize(("by_time", "newest"), [(True, 0), (False, 2)])
def test_a_listing_in_no_order_is_complete_before_the_newest_is_known(by_time: bool, newest: int) -> None:
    """PX4's last number is that of whichever file its file system lists last."""
    transfer = LogTransfer(1, None, Instant(0), by_time=by_time)
    assert isinstance(transfer.requests(Instant(1))[0], LogRequestList)
    for number, utc_s in ((1, 1_500), (0, 1_900), (2, 1_700)):
        transfer.take(LogEntry(number, 3, 2, utc_s, 1000), Instant(2))
    assert transfer.entry is not None
    assert (transfer.entry.id, transfer.stage) == (newest, Stage.FETCHING)
