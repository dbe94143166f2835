"""The telemetry log: frames as they are, but for keys."""

from pathlib import Path

from airlink.clock import Instant
from airlink.frame import FrameWriter, StreamParser
from airlink.messages.system import Heartbeat, SetupSigning, Statustext
from gcs_formation.record.tlog import TlogWriter, read_tlog

KEY = tuple(range(1, 33))


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
