"""The record of ground truth: what it holds, and that it can be read while it's written."""

import numpy as np
import pytest

import sim_vehicles.truth as truth_file
from sim_vehicles.truth import HEADER, TruthError, TruthRecord, TruthWriter

LOOP_S = 0.02


def read_truth(path):
    """Return all rows."""
    return TruthRecord(path).until(np.inf)


@pytest.fixture
def recorded(make_air, tmp_path):
    """Return the file and the states of 10 s of two flying vehicles, recorded at 25 Hz."""
    air, path, states = make_air(2, wind_mps=(1.0, 2.0, 0.0)), tmp_path / "truth.bin", []
    with TruthWriter(path, 2) as writer:
        for turn in range(500):
            air.run(LOOP_S)
            writer(air.fleet.next_timer() - 20_000_000, air.fleet)
            if turn % 2 == 1:
                now = [body.state for body in air.fleet.bodies]
                states.append(([each.north_m for each in now], [each.airspeed_mps for each in now]))
    return path, states


def test_rows_are_the_fleet_s_states_at_half_the_main_loop_s_rate(recorded):
    truth = read_truth(recorded[0])
    assert truth["time_s"] == pytest.approx(np.arange(1, 251) * 0.04)
    assert truth["north_m"].tolist() == [north for north, _ in recorded[1]]
    assert truth["airspeed_mps"].tolist() == [airspeed for _, airspeed in recorded[1]]


def test_the_velocity_is_the_derivative_of_the_position(recorded):
    truth = read_truth(recorded[0])
    assert np.diff(truth["north_m"], axis=0) / 0.04 == pytest.approx(truth["north_mps"][1:], abs=1e-9)
    assert np.diff(truth["east_m"], axis=0) / 0.04 == pytest.approx(truth["east_mps"][1:], abs=1e-9)


def test_what_falls_out_of_the_air_is_airborne_no_more(make_air, tmp_path):
    air, path = make_air(2), tmp_path / "truth.bin"
    with TruthWriter(path, 2) as writer:
        for turn in range(6):
            air.run(LOOP_S)
            writer(air.fleet.next_timer() - 20_000_000, air.fleet)
            if turn == 1:
                air.fleet.vehicles[1].disarm(force=True)
    assert read_truth(path)["airborne"].tolist() == [[1.0, 1.0], [1.0, 0.0], [1.0, 0.0]]


@pytest.mark.parametrize("step_s", [0.01, 0.1, 3.0])
def test_rows_that_are_read_piece_by_piece_are_those_around_the_times_in_between(recorded, monkeypatch, step_s):
    monkeypatch.setattr(truth_file, "BLOCK_BYTES", 1000)
    whole, record, known_s = read_truth(recorded[0]), TruthRecord(recorded[0]), np.arange(1, 251) * 0.04
    assert record.last_s == pytest.approx(10.0)
    for begin_s in np.arange(0.0, 11.0, step_s):
        piece = record.until(begin_s + step_s)
        first = int(np.flatnonzero(whole["time_s"] == piece["time_s"][0])[0])
        for name, column in piece.items():
            np.testing.assert_array_equal(column, whole[name][first : first + len(column)])
        assert len(piece["time_s"]) >= 2
        assert piece["time_s"][0] <= max(known_s[0], begin_s)
        assert piece["time_s"][-1] > begin_s + step_s or piece["time_s"][-1] == whole["time_s"][-1]


@pytest.mark.parametrize("cut", [1, 7, 8, 60, 135])
def test_a_torn_last_row_is_left_out(recorded, cut):
    path, _ = recorded
    path.write_bytes(path.read_bytes()[:-cut])
    assert read_truth(path)["north_m"].shape == (249, 2)


def test_a_file_of_the_header_alone_has_no_rows(recorded):
    path, _ = recorded
    path.write_bytes(path.read_bytes()[: HEADER.size])
    assert read_truth(path)["north_m"].shape == (0, 2)


@pytest.mark.parametrize("content", [b"", b"truth", b"x" * 200])
def test_anything_else_is_no_record(tmp_path, content):
    path = tmp_path / "other"
    path.write_bytes(content)
    with pytest.raises(TruthError, match="not a record of ground truth"):
        read_truth(path)
