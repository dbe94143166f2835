"""The ticks of a flight as they are recorded, and read back after a crash or a resumption."""

from __future__ import annotations

import json
import math
from pathlib import Path

import numpy as np
import pytest

from airlink.clock import Instant, after
from airlink.endpoint import VehicleId
from flight_model.flight_state import FlightState
from gcs_formation.control.law_interface import LawOutput
from gcs_formation.errors import RecordError
from gcs_formation.record import timeseries
from gcs_formation.record.timeseries import (
    PHASES,
    SPOOLED,
    VIRTUAL_LEADER,
    WAITING_TICKS,
    Spool,
    SpoolWriter,
    spools,
)
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


def full_tick(at_s: float, *, leader: int) -> Tick:
    """Return a tick of which every value of the second column is known, and none is equal to another."""
    now, made = after(Instant(0), at_s), tick(at_s)
    made.mission_time_s, made.phase, made.leader = 12.0, "ending", leader
    link = made.links[1]
    link.delay_s, link.up_s, link.down_s, link.jitter_s, link.airborne = 0.31, 0.32, 0.33, 0.34, False
    made.now, made.age_s[1], made.margin_used[1], made.active[1], made.yielding[1] = now, 0.35, 0.36, True, True
    made.state[1] = FlightState(1.0, 2.0, 3.0, 4.0, 5.0, 6.0, 7.0, 8.0)
    made.setpoints[1], made.slots_m[1] = (9.0, 10.0, 11.0), (12.0, 13.0, 14.0)
    gains = (21.0, 22.0, 23.0, 24.0, 25.0, 26.0, 27.0, 28.0, 29.0)
    made.decided[1] = LawOutput(1, made.state[1], (0.0, 0.0, 0.0), (15.0, 16.0, 17.0), (18.0, 19.0, 20.0), gains)
    return made


KNOWN = {
    "phase": PHASES.index("ending"), "t_s": 2.5, "mission_time_s": 12.0,
    "north_m": 1.0, "east_m": 2.0, "height_m": 3.0, "climb_mps": 4.0, "airspeed_mps": 5.0, "heading_rad": 6.0,
    "wind_north_mps": 7.0, "wind_east_mps": 8.0,
    "setpoint_speed_mps": 9.0, "setpoint_heading_rad": 10.0, "setpoint_height_m": 11.0,
    "age_s": 0.35, "delay_s": 0.31, "up_s": 0.32, "down_s": 0.33, "jitter_s": 0.34, "margin_used": 0.36,
    "active": 1.0, "leads": 0.0, "yielding": 1.0, "airborne": 0.0,
    "slot_forward_m": 12.0, "slot_right_m": 13.0, "slot_up_m": 14.0,
    "law_error_x_m": 15.0, "law_error_y_m": 16.0, "law_error_z_m": 17.0,
    "mixed_speed_mps": 18.0, "mixed_heading_rad": 19.0, "mixed_height_m": 20.0,
    "kp_speed": 21.0, "kp_heading": 22.0, "kp_height": 23.0, "ki_speed": 24.0, "ki_heading": 25.0, "ki_height": 26.0,
    "kd_speed": 27.0, "kd_heading": 28.0, "kd_height": 29.0,
}  # fmt: skip
"""The columns of docs/timeseries.md that come from a tick, with the values of `full_tick`."""


def test_every_column_of_a_tick_has_its_own_value(tmp_path: Path) -> None:
    """The other vehicle leads: it has no slot, and without a decision of the law no error, mixed error or gain."""
    spool = SpoolWriter(tmp_path / "ticks", TWO)
    spool.add(full_tick(2.5, leader=0))
    spool.close()
    rows = Spool(tmp_path / "ticks").read()
    assert list(rows) == ["network", "vehicle", *SPOOLED]
    assert {name: values[1] for name, values in rows.items()} == KNOWN | {"network": 1, "vehicle": 3}
    assert rows["leads"].tolist() == [1.0, 0.0]
    assert rows["airborne"].tolist() == [1.0, 0.0]
    unknown = [name for name in SPOOLED if name.startswith(("law_", "mixed_", "kp_", "ki_", "kd_"))]
    assert all(math.isnan(rows[name][0]) for name in unknown)


@pytest.mark.parametrize("known", [True, False])
def test_behind_a_virtual_leader_each_row_says_where_it_is_and_it_has_none(tmp_path: Path, *, known: bool) -> None:
    made = full_tick(2.5, leader=0)
    made.virtual_leader = FlightState(31.0, 32.0, 33.0, 0.0, 20.0, 34.0, 0.0, 0.0) if known else None
    spool = SpoolWriter(tmp_path / "ticks", [None, VehicleId(1, 3)])
    spool.add(made)
    spool.close()
    rows = Spool(tmp_path / "ticks").read()
    assert {name: values.tolist() for name, values in rows.items() if name in KNOWN} == {
        name: [value] for name, value in KNOWN.items()
    }
    expected = (31.0, 32.0, 33.0, 34.0) if known else (math.nan,) * 4
    np.testing.assert_array_equal([rows[name][0] for name in VIRTUAL_LEADER], expected)


@pytest.mark.parametrize("at_once", [1, 2, 5, 6, 100])
def test_a_spool_is_read_in_blocks_of_whole_ticks(
    at_once: int, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    """Of up to a number of rows, or of one tick; those of one file aren't in a block with those of the next."""
    for begin_s in (0.0, 50.0):
        written(tmp_path / "ticks", [begin_s + 0.1 * each for each in range(5)]).close()
    monkeypatch.setattr(timeseries, "ROWS_AT_ONCE", at_once)
    spool = Spool(tmp_path / "ticks")
    sizes = [block["t_s"].size for block in spool.blocks()]
    ticks = max(1, at_once // 2)
    each = [min(ticks, 5 - begin) * 2 for begin in range(0, 5, ticks)]
    assert sizes == [*each, *each]
    assert spool.ticks == 10
    times_s = [0.1 * each for each in range(5)]
    np.testing.assert_allclose(spool.read()["t_s"], np.repeat([*times_s, *(50.0 + at for at in times_s)], 2))


def test_a_spool_without_a_tick_has_columns_without_rows(tmp_path: Path) -> None:
    """Nor has one whose first line was cut, or the second file of a run that was resumed in vain."""
    path = tmp_path / "ticks"
    written(path, []).close()
    assert (Spool(path).ticks, Spool(path).read()["t_s"].size) == (0, 0)
    path.write_bytes(b'{"vehicles"')
    assert (Spool(path).ticks, Spool(path).read()["north_m"].size) == (0, 0)
    path.unlink()
    written(path, [1.0]).close()
    written(path, []).close()
    assert spools(path) == [path, path.with_name("ticks.2")]
    assert Spool(path).read()["t_s"].tolist() == [1.0, 1.0]


@pytest.mark.parametrize("values", [SPOOLED[1:], (*SPOOLED, "more"), ()])
def test_a_spool_of_another_version_is_refused(values: tuple[str, ...], tmp_path: Path) -> None:
    (tmp_path / "ticks").write_text(json.dumps({"vehicles": [[1, 1]], "values": values}) + "\n")
    with pytest.raises(RecordError, match="found other values than this version's in"):
        Spool(tmp_path / "ticks")


def test_what_was_flushed_is_read_while_a_run_goes_on(tmp_path: Path) -> None:
    spool = written(tmp_path / "ticks", [1.0])
    assert Spool(tmp_path / "ticks").ticks == 0
    spool.flush()
    assert Spool(tmp_path / "ticks").ticks == 1
    spool.flush()
    spool.add(tick(1.1))
    spool.close()
    assert Spool(tmp_path / "ticks").read()["t_s"].tolist() == [1.0, 1.0, 1.1, 1.1]
