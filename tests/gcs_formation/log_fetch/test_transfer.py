"""The transfer of a log over links that lose: an engine of the vehicle's side in a few lines."""

import random
import struct

import pytest

from airlink.clock import Instant, after
from airlink.messages import Message
from airlink.messages.command import LogData, LogEntry, LogRequestData, LogRequestEnd, LogRequestList
from gcs_formation.log_fetch.log_times import last_s
from gcs_formation.log_fetch.transfer import BLOCK, PATIENCE_S, LogTransfer, Stage

CONTENT = bytes(random.Random(3).randrange(256) for _ in range(BLOCK * 40 + 17))


def answers(message: Message, content: bytes = CONTENT, size: int | None = None) -> list[Message]:
    """Return what an autopilot with two logs sends."""
    if isinstance(message, LogRequestList):
        told = len(content) if size is None else size
        return [LogEntry(4, 2, 5, 0, 12), LogEntry(5, 2, 5, 0, told)]
    if not isinstance(message, LogRequestData):
        return []
    assert message.id == 5
    until = min(message.ofs + message.count, len(content))
    blocks = [content[at : min(at + BLOCK, until)] for at in range(message.ofs, until, BLOCK)]
    return [LogData(5, message.ofs + BLOCK * n, len(part), tuple(part)) for n, part in enumerate(blocks)]


def fetched(transfer: LogTransfer, loss: float = 0.0, size: int | None = None, limit: int = 4000) -> bytes:
    """Return what a transfer brings over a link that loses a share of all messages each way."""
    dice, got, asked = random.Random(1), list[bytes](), 0
    for step in range(limit):
        now = after(Instant(0), 0.1 * step)
        for request in transfer.requests(now):
            asked += 1
            for answer in answers(request, size=size) if dice.random() >= loss else []:
                if dice.random() >= loss:
                    transfer.take(answer, now)
        got += transfer.chunks()
        if transfer.over:
            return b"".join(got)
    raise AssertionError(f"found {transfer.stage} after {asked} requests")


@pytest.mark.parametrize("loss", [0.0, 0.1, 0.5])
def test_all_of_it_comes_in_order_whatever_is_lost(loss: float) -> None:
    transfer = LogTransfer(7, None, Instant(0))
    assert fetched(transfer, loss) == CONTENT
    assert transfer.entry is not None
    assert (transfer.stage, transfer.entry.id) == (Stage.DONE, 5)
    assert [type(each) for each in transfer.requests(after(Instant(0), 999.0))] == [LogRequestEnd]


def test_what_is_there_is_not_asked_for_again() -> None:
    transfer = LogTransfer(7, None, Instant(0), lambda entry: BLOCK * 30 if entry.id == 5 else 0)
    assert fetched(transfer) == CONTENT[BLOCK * 30 :]
    complete = LogTransfer(7, None, Instant(0), lambda entry: entry.size)
    assert (fetched(complete), complete.stage) == (b"", Stage.DONE)


def test_a_log_that_is_shorter_than_its_list_says_ends_with_its_last_block() -> None:
    """ArduPilot's list is of the file's size when it was asked for."""
    assert fetched(LogTransfer(7, None, Instant(0)), size=len(CONTENT) + 500) == CONTENT


def test_a_log_of_a_number_is_chosen_or_those_that_there_are_named() -> None:
    transfer = LogTransfer(7, 3, Instant(0))
    fetched(transfer)
    assert transfer.failure == "found no log 3; allowed: 4, 5"
    none = LogTransfer(7, None, Instant(0))
    none.take(LogEntry(0, 0, 0, 0, 0), Instant(0))
    assert none.failure == "it has no logs"


def test_one_that_falls_silent_is_given_up() -> None:
    transfer = LogTransfer(7, None, Instant(0))
    assert transfer.requests(Instant(0))
    assert transfer.requests(after(Instant(0), PATIENCE_S + 1.0)) == []
    assert "while waiting for its list of logs" in transfer.failure


def test_the_latest_time_of_a_log_is_that_of_its_last_timed_message() -> None:
    def form(kind: int, length: int, letters: bytes, columns: bytes) -> bytes:
        return b"\xa3\x95\x80" + struct.pack("<BB4s16s64s", kind, length, b"ABCD", letters, columns)

    timed, other = form(9, 3 + 8 + 1, b"QB", b"TimeUS,I"), form(10, 3 + 8, b"d", b"Value")
    content = timed + other + b"\xa3\x95\x09" + struct.pack("<QB", 5_000_000, 1)
    content += (
        b"\xa3\x95\x0a" + struct.pack("<d", 1e9) + b"\x00\xa3" + b"\xa3\x95\x09" + struct.pack("<QB", 7_500_000, 1)
    )
    assert last_s(content) == 7.5
    assert last_s(b"ULog\x01\x12\x35\x01" + struct.pack("<Q", 2_000_000)) == 2.0
    assert last_s(b"\xa3\x95") is None
    assert last_s(b"") is None
