"""The record of ground truth: its content, and that it can be read while it's written."""

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from sim_vehicles.truth import HEADER, MAGIC, QUANTITIES, TruthError, TruthRecord, TruthWriter

LOOP_S = 0.02


def read_truth(path):
    """Return all rows."""
    return TruthRecord(path).between(-np.inf, np.inf)


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


@pytest.fixture(scope="module")
def long_record(tmp_path_factory):
    """Return a record of 10 s of three vehicles, and all its rows."""
    path, rng = tmp_path_factory.mktemp("truth") / "truth.bin", np.random.default_rng(1)
    rows = np.column_stack((np.arange(1, 251) * 0.04, rng.normal(size=(250, 3 * len(QUANTITIES)))))
    path.write_bytes(HEADER.pack(MAGIC, 3) + rows.tobytes())
    return TruthRecord(path), read_truth(path)


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


@given(st.floats(-1.0, 11.0), st.floats(0.0, 11.0))
def test_rows_between_two_times_are_all_that_values_between_them_are_interpolated_from(long_record, from_s, over_s):
    record, whole = long_record
    some = record.between(from_s, from_s + over_s)
    assert record.last_s == whole["time_s"][-1]
    first = int(np.flatnonzero(whole["time_s"] == some["time_s"][0])[0])
    for name, column in some.items():
        np.testing.assert_array_equal(column, whole[name][first : first + len(column)])
    assert len(some["time_s"]) >= 2
    assert first == 0 or some["time_s"][0] <= from_s or some["time_s"][-1] == record.last_s
    assert some["time_s"][-1] > from_s + over_s or some["time_s"][-1] == record.last_s
    wanted_s = np.linspace(from_s, from_s + over_s, 7)
    expected, found = (np.interp(wanted_s, each["time_s"], each["north_m"][:, 1]) for each in (whole, some))
    np.testing.assert_array_equal(found, expected)


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
