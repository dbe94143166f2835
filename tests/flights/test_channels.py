"""Flights over one radio for all vehicles."""

from __future__ import annotations

import json
from pathlib import Path
from typing import Any

import numpy as np
import pyarrow.parquet as pq
import pytest

import gcs_formation
from airlink.messages.system import RadioStatus
from airlink.radio.settings import RADIO
from airlink.stream_parser import StreamParser
from gcs_formation.record.tlog import read_tlog
from tests.processes import free_port


def over(tmp_path: Path, name: str, channel: dict[str, Any], **options: Any) -> dict[str, Any]:
    port = options.pop("port", 14550)
    scenario = {
        "vehicles": {"count": 2, "endpoint": f"udpin:127.0.0.1:{port}"},
        "start": {"in_air": True},
        "path": {"speed_mps": 22.0, "waypoints_m": [[0, 0, 100], [2000, 0, 100]]},
        "links": {"channels": [channel]},
    }
    return gcs_formation.run(scenario, until=6.0, out=tmp_path / name, **options).to_dict()


WIDE = {"rate_kbps": 150, "duplex": "half", "turnaround_ms": 2, "loss": 0.02}


def test_a_flight_over_one_radio_repeats_and_its_reports_are_recorded_and_are_no_vehicles(tmp_path: Path) -> None:
    summary, again = (over(tmp_path, name, WIDE, clock="virtual") for name in ("one", "two"))
    assert (tmp_path / "one" / "flight.tlog").read_bytes() == (tmp_path / "two" / "flight.tlog").read_bytes()
    assert summary["links"] == again["links"]
    assert summary["followers"]["2"]["error_x_m"]["rms"] < 0.1
    assert summary["received"]["frames_refused"] == 0
    events = [json.loads(line) for line in (tmp_path / "one" / "events.jsonl").read_text().splitlines()]
    assert not any(each["kind"] in {"stranger", "own_id"} for each in events)
    frames = StreamParser().feed(b"".join(raw for _, raw in read_tlog(tmp_path / "one" / "flight.tlog")))
    said = [frame for frame in frames if isinstance(frame.message, RadioStatus)]
    assert {(frame.system, frame.component) for frame in said} == {RADIO}
    radio = summary["links"]["2"]["radio"]
    assert radio["reports"] == summary["links"]["1"]["radio"]["reports"] == len(said) / 2
    assert 0 <= radio["txbuf_percent"]["min"] < radio["txbuf_percent"]["max"] <= 100
    assert radio["rxerrors"] > 0
    table = pq.read_table(tmp_path / "one" / "timeseries.parquet")
    txbuf = table["radio_txbuf_percent"].to_numpy()
    assert np.nanmin(txbuf) >= radio["txbuf_percent"]["min"]
    link = summary["links"]["2"]
    assert 0.0 < link["injected_loss"] < 0.05
    assert link["injected_delay_ms"] > 3.0


@pytest.mark.slow
def test_the_same_radio_over_sockets(tmp_path: Path) -> None:
    summary = over(tmp_path, "real", WIDE, clock="real", speedup=2.0, port=free_port())
    assert summary["followers"]["2"]["error_x_m"]["rms"] < 0.2
    assert summary["links"]["2"]["radio"]["reports"] > 10
    assert summary["links"]["2"]["injected_delay_ms"] > 3.0
