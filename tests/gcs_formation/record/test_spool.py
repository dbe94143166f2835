"""The ticks of a flight as they are recorded, and read back after a crash or a resumption."""

from __future__ import annotations

import math
from pathlib import Path

import numpy as np

from airlink.clock import Instant, after
from airlink.endpoint import VehicleId
from flight_model.flight_state import FlightState
from gcs_formation.record.timeseries import PHASES, WAITING_TICKS, Spool, SpoolWriter
from gcs_formation.recorder import Tick, VehicleLink

TWO = [VehicleId(0, 3), VehicleId(1, 3)]


def tick(at_s: float) -> Tick:
    """Return a tick at which the second vehicle leads, and the first one follows 30 m behind it."""
    now = after(Instant(0), at_s)
    made = Tick(now, math.nan, "flying", 1, [VehicleLink(now), VehicleLink(now)], [0.1, 0.2], [0.0, 0.5], [True, False])
    made.state = [FlightState(100.0 * each, 5.0, 80.0, 0.0, 20.0, 0.3, 0.0, 0.0) for each in range(2)]
    made.setpoints[0] = (21.0, 0.4, 90.0)
    made.slots_m[0] = (-30.0, 0.0, 0.0)
    return made


def written(path: Path, times_s: list[float]) -> SpoolWriter:
    spool = SpoolWriter(path, TWO)
    for at_s in times_s:
        spool.add(tick(at_s))
    return spool


def test_each_vehicle_has_a_row_at_each_tick_with_its_values_by_their_names(tmp_path: Path) -> None:
    written(tmp_path / "ticks", [1.0, 1.1]).close()
    rows = Spool(tmp_path / "ticks").read()
    expected = {
        "t_s": [1.0, 1.0, 1.1, 1.1],
        "network": [0, 1] * 2,
        "vehicle": [3, 3] * 2,
        "phase": [PHASES.index("flying")] * 4,
        "north_m": [0.0, 100.0] * 2,
        "heading_rad": [0.3] * 4,
        "setpoint_height_m": [90.0, math.nan] * 2,
        "slot_forward_m": [-30.0, math.nan] * 2,
        "age_s": [0.1, 0.2] * 2,
        "margin_used": [0.0, 0.5] * 2,
        "active": [1.0, 0.0] * 2,
        "leads": [0.0, 1.0] * 2,
        "mission_time_s": [math.nan] * 4,
    }
    for name, values in expected.items():
        np.testing.assert_array_equal(rows[name], values, err_msg=name)


def test_of_a_run_that_crashed_the_ticks_that_are_whole_are_read(tmp_path: Path) -> None:
    path = tmp_path / "ticks"
    spool = written(path, [0.1 * each for each in range(WAITING_TICKS)])
    assert Spool(path).ticks == WAITING_TICKS, "that many are on the disk while it goes on"
    spool.close()
    with path.open("ab") as file:
        file.write(b"\0" * 20)
    assert Spool(path).ticks == WAITING_TICKS
    assert Spool(path).read()["t_s"].size == 2 * WAITING_TICKS


def test_a_resumed_runs_ticks_come_after_those_before_it(tmp_path: Path) -> None:
    for begin_s in (0.0, 50.0, 100.0):
        written(tmp_path / "ticks", [begin_s, begin_s + 0.1]).close()
    assert Spool(tmp_path / "ticks").read()["t_s"][::2].tolist() == [0.0, 0.1, 50.0, 50.1, 100.0, 100.1]
