"""The telemetry log: frames as they are, but for keys, at the times at which they were written."""

from __future__ import annotations

import struct
from pathlib import Path

import pytest
from pymavlink import mavutil

from airlink.clock import Instant, after
from airlink.frame import FrameWriter
from airlink.messages.system import Heartbeat, SetupSigning, Statustext
from airlink.stream_parser import StreamParser
from gcs_formation.record.tlog import TlogWriter, read_tlog

KEY = tuple(range(1, 33))
EPOCH_US = 1_577_836_800_000_000
"""2020-01-01 00:00 UTC."""


def test_a_key_that_is_heard_is_recorded_as_zeros_and_everything_else_as_it_came(tmp_path: Path) -> None:
    writer, file = FrameWriter(255, 190), tmp_path / "flight.tlog"
    raws = [writer.encode(each) for each in (Heartbeat(6, 8), SetupSigning(2, 1, KEY, 77), Statustext(6, "a" * 50))]
    raws.append(writer.encode(Heartbeat(6, 8), 1))
    log = TlogWriter(file, 0)
    log.write(Instant(0), raws)
    log.close()
    recorded = [raw for _, raw in read_tlog(file)]
    assert [recorded[0], *recorded[2:]] == [raws[0], *raws[2:]]
    assert [each.message for each in StreamParser().feed(recorded[1])] == [SetupSigning(2, 1, (0,) * 32, 77)]
    assert bytes(KEY) not in file.read_bytes()


def beats(count: int) -> list[bytes]:
    """Return heartbeats, each with another sequence number."""
    writer = FrameWriter(1, 1)
    return [writer.encode(Heartbeat(1, 3)) for _ in range(count)]


def test_pymavlink_reads_the_frames_with_the_times_at_which_they_were_written(tmp_path: Path) -> None:
    """Those of one call have one time: microseconds since 1970, big-endian, before each frame."""
    file, raws = tmp_path / "flight.tlog", beats(4)
    log = TlogWriter(file, EPOCH_US)
    for at_s, some in ((0.0, raws[:1]), (1.5, raws[1:3]), (7200.25, raws[3:])):
        log.write(after(Instant(0), at_s), some)
    log.close()
    read = mavutil.mavlink_connection(str(file))
    found = [read.recv_msg() for _ in raws]
    assert [each.get_msgbuf() for each in found] == [bytearray(raw) for raw in raws]
    assert [each._timestamp - EPOCH_US / 1e6 for each in found] == [0.0, 1.5, 1.5, 7200.25]
    assert read.recv_msg() is None
    assert file.read_bytes().startswith(struct.pack(">q", EPOCH_US) + raws[0])
    read.close()


def test_a_time_is_in_whole_microseconds(tmp_path: Path) -> None:
    log = TlogWriter(tmp_path / "flight.tlog", 5)
    log.write(Instant(1_999), beats(1))
    log.close()
    assert [at_us for at_us, _ in read_tlog(tmp_path / "flight.tlog")] == [6]


@pytest.mark.parametrize("frame", [bytes((0xFE, 0, 1, 1, 1, 42, 7, 8)), bytes((0xFE, 1, 1, 1, 1, 42, 9, 7, 1))])
def test_frames_of_version_1_are_recorded_however_short(frame: bytes, tmp_path: Path) -> None:
    log = TlogWriter(tmp_path / "flight.tlog", 0)
    log.write(Instant(0), [frame, *beats(1)])
    log.close()
    assert [raw for _, raw in read_tlog(tmp_path / "flight.tlog")] == [frame, *beats(1)]


def test_what_was_flushed_outlives_a_crash_and_a_log_closes_once(tmp_path: Path) -> None:
    file, raws = tmp_path / "flight.tlog", beats(2)
    log = TlogWriter(file, 0)
    log.write(Instant(0), raws[:1])
    assert list(read_tlog(file)) == []
    log.flush()
    assert list(read_tlog(file)) == [(0, raws[0])]
    log.flush()
    log.write(Instant(1000), raws[1:])
    log.close()
    log.close()
    assert list(read_tlog(file)) == [(0, raws[0]), (1, raws[1])]


@pytest.mark.parametrize("lacking", [1, 5, 16, 17, 20, 24])
def test_a_log_is_continued_after_its_last_whole_frame(lacking: int, tmp_path: Path) -> None:
    """A heartbeat has 21 bytes, its time 8."""
    file, raws = tmp_path / "flight.tlog", beats(3)
    log = TlogWriter(file, 0)
    log.write(Instant(0), raws[:2])
    log.close()
    file.write_bytes(file.read_bytes()[:-lacking])
    assert [raw for _, raw in read_tlog(file)] == raws[:1]
    resumed = TlogWriter(file, 0)
    resumed.write(Instant(3_000_000), raws[2:])
    resumed.close()
    assert list(read_tlog(file)) == [(0, raws[0]), (3000, raws[2])]


def test_nothing_is_read_behind_bytes_that_begin_no_frame(tmp_path: Path) -> None:
    file, stamp = tmp_path / "flight.tlog", struct.pack(">q", 9)
    file.write_bytes(stamp + beats(1)[0] + stamp + b"\x00" * 40)
    assert list(read_tlog(file)) == [(9, beats(1)[0])]
    with pytest.raises(IsADirectoryError):
        list(read_tlog(tmp_path))
