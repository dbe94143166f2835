"""The comparison of what is said over UDP, in its order, however often."""

from __future__ import annotations

from pathlib import Path

from tests.gcs_formation.diff.records import command, heartbeat, write_tlog
from tests.reference_flights import protocol


def test_a_protocol_is_what_is_said_in_its_order_however_often(tmp_path: Path) -> None:
    base = write_tlog(tmp_path / "base", heartbeat(1), command(511, 30.0), command(511, 33.0), command(400))
    often = write_tlog(tmp_path / "often", command(511, 30.0), command(511, 33.0), *[heartbeat(1)] * 3, command(400))
    assert protocol.difference(base, often) is None
    turned = write_tlog(tmp_path / "turned", heartbeat(1), command(511, 33.0), command(511, 30.0), command(400))
    assert (protocol.difference(base, turned) or "").startswith("COMMAND_LONG of system 255 to 2: ")
    silent = write_tlog(tmp_path / "silent", command(511, 30.0), command(511, 33.0), command(400))
    assert protocol.difference(base, silent) == "HEARTBEAT of system 1 to 0: type 1, now nothing"
