"""Ground truth of simulators' logs, on the run's clock."""

from __future__ import annotations

import math
import struct
from collections.abc import Iterable
from pathlib import Path

import numpy as np
import pytest

from flight_model.earth import GeodeticOrigin
from gcs_formation.app.sitl.families.arduplane import SIMULATOR as ARDUPLANE
from gcs_formation.app.sitl.families.px4 import SIMULATOR as PX4
from gcs_formation.app.sitl.simulator import TrueMotion
from gcs_formation.app.sitl.truth import LoggedTruth, to_run_s
from tests.gcs_formation.identify.log_bytes import write_ulog

ORIGIN = GeodeticOrigin(math.radians(35.0), math.radians(125.0), 100.0)
SPEED_MPS = 22.0
KINDS = {
    "FMT": (128, "<BB4s16s64s", "BBnNZ", "Type,Length,Name,Format,Columns"),
    "SIM": (90, "<QccCfLL", "QccCfLL", "TimeUS,Roll,Pitch,Yaw,Alt,Lat,Lng"),
    "SIM2": (91, "<Qdddfffff", "Qdddfffff", "TimeUS,PN,PE,PD,VN,VE,VD,As,ASpdU"),
}
STRUCT = {"SIM": "<QhhHfii", "SIM2": "<Qdddfffff"}


def write_simulators_log(file: Path, rows: Iterable[tuple[str, tuple[float, ...]]]) -> Path:
    """Write an ArduPilot log of SIM and SIM2, packed as the simulator does."""
    data = bytearray()
    sizes = {"FMT": 89, **{kind: 3 + struct.calcsize(form) for kind, form in STRUCT.items()}}
    for kind, (number, _, types, columns) in KINDS.items():
        packed = struct.pack("<BB4s16s64s", number, sizes[kind], kind.encode(), types.encode(), columns.encode())
        data += b"\xa3\x95\x80" + packed
    for kind, values in rows:
        data += b"\xa3\x95" + bytes([KINDS[kind][0]]) + struct.pack(STRUCT[kind], *values)
    file.write_bytes(bytes(data))
    return file


def flown_north(boot_s: float, at_s: float) -> list[tuple[str, tuple[float, ...]]]:
    """Return rows of a vehicle that flies north at 22 m/s, 80 m above a field at 100 m, the nose to 90 degrees."""
    lat_deg = math.degrees(ORIGIN.from_ned(SPEED_MPS * at_s, 0.0, 0.0)[0])
    stamp = round((boot_s + at_s) * 1e6)
    placed = (stamp, 0, 0, 9000, 180.0, round(lat_deg * 1e7), 1_250_000_000)
    return [("SIM", placed), ("SIM2", (stamp, 0.0, 0.0, 0.0, SPEED_MPS, 0.0, -1.0, 20.5, 1.0))]


def test_ardu_pilots_log_says_where_the_vehicle_was(tmp_path: Path) -> None:
    rows = [row for at_s in np.arange(0.0, 2.0, 0.1) for row in flown_north(20.0, float(at_s))]
    (logs := tmp_path / "logs").mkdir()
    write_simulators_log(logs / "00000001.BIN", rows)
    motion = ARDUPLANE.true_motion(tmp_path)
    assert motion is not None
    assert motion.boot_s[[0, -1]] == pytest.approx([20.0, 21.9])
    assert motion.heading_rad == pytest.approx(math.pi / 2)
    assert (motion.airspeed_mps[0], motion.climb_mps[0], motion.north_mps[0]) == pytest.approx((20.5, 1.0, 22.0))


def test_a_log_without_true_motion_has_none(tmp_path: Path) -> None:
    assert ARDUPLANE.true_motion(tmp_path) is None
    write_simulators_log(tmp_path / "00000001.BIN", [])
    assert ARDUPLANE.true_motion(tmp_path) is None
    assert PX4.true_motion(tmp_path) is None


def test_px4s_log_says_where_the_vehicle_was(tmp_path: Path) -> None:
    placed, moving = "vehicle_global_position_groundtruth", "vehicle_local_position_groundtruth"
    topics = {placed: "double lat;double lon;float alt", moving: "float vx;float vy;float vz;float heading"}
    rows: list[tuple[str, float, tuple[float, ...]]] = [
        (placed, at_s, (35.0 + at_s / 1e4, 125.0, 150.0)) for at_s in (1.0, 2.0)
    ]
    rows += [(moving, at_s, (3.0, 4.0, -1.0, 0.5)) for at_s in (1.0, 1.5, 2.0)]
    write_ulog(tmp_path / "log.ulg", topics, rows)
    motion = PX4.true_motion(tmp_path)
    assert motion is not None
    assert np.degrees(motion.lat_rad) == pytest.approx([35.0001, 35.00015, 35.0002])
    assert (motion.climb_mps[0], motion.heading_rad[0]) == pytest.approx((1.0, 0.5))
    assert motion.airspeed_mps == pytest.approx(math.sqrt(26.0))
    write_ulog(tmp_path / "log.ulg", topics, rows, SIH_WIND_N=3.0, SIH_WIND_E=4.0)
    in_wind = PX4.true_motion(tmp_path)
    assert in_wind is not None
    assert in_wind.airspeed_mps == pytest.approx(math.hypot(6.0, 8.0, 1.0)), "it comes from ahead"


def test_a_vehicles_time_becomes_the_runs_by_the_clock_that_was_noted_then() -> None:
    """Its clock began 7 s before ours, and gains 1 %."""
    offsets = [(at_s, 7.0 + 0.01 * at_s) for at_s in (0.0, 10.0, 20.0)]
    assert to_run_s(np.array([7.0, 12.05, 27.2]), offsets) == pytest.approx([0.0, 5.0, 20.0])


def test_vehicles_of_different_clocks_are_brought_to_common_times() -> None:
    def motion(boot_s: float) -> TrueMotion:
        at_s = np.arange(0.0, 10.0, 0.1)
        lat_rad = np.array([ORIGIN.from_ned(SPEED_MPS * each, 0.0, 0.0)[0] for each in at_s])
        still, ones = np.zeros_like(at_s), np.ones_like(at_s)
        height_m = np.minimum(10.0 * at_s, 80.0)
        speed = SPEED_MPS * ones
        moving = (speed, still, still, still, speed)
        return TrueMotion(boot_s + at_s, lat_rad, ORIGIN.lon_rad * ones, ORIGIN.alt_m + height_m, *moving)

    truth = LoggedTruth([motion(3.0), motion(50.0)], [[(0.0, 3.0)], [(0.0, 50.0)]], [False, False], ORIGIN)
    rows = truth.between(4.0, 5.0)
    assert rows["time_s"][0] <= 4.0 < rows["time_s"][1]
    assert rows["north_m"] == pytest.approx(SPEED_MPS * np.stack([rows["time_s"]] * 2, axis=1), abs=0.01)
    assert rows["height_m"][:, 1] == pytest.approx(10.0 * rows["time_s"], abs=0.1)
    early = truth.between(-10.0, 0.05)
    assert early["airborne"][0].tolist() == [0.0, 0.0]
    late = truth.between(20.0, 30.0)
    assert late["north_mps"][-1].tolist() == [0.0, 0.0]
    assert late["north_m"][-1] == pytest.approx(SPEED_MPS * 9.9, abs=0.01)


def test_the_heading_of_one_that_hovers_is_the_axis_of_slots_behind_it() -> None:
    """Its nose points 6 degrees off its course: a formation of 36 m would be judged 3.6 m beside where it is."""

    def heading_deg(speed_mps: float, *, hovers: bool) -> float:
        still, ones = np.zeros(5), np.ones(5)
        placed = np.arange(5.0), ORIGIN.lat_rad * ones, ORIGIN.lon_rad * ones, ORIGIN.alt_m * ones
        moving = (speed_mps * ones, still, still, np.radians(6.0) * ones, still)
        truth = LoggedTruth([TrueMotion(*placed, *moving)], [[(0.0, 0.0)]], [hovers], ORIGIN)
        return math.degrees(truth.between(1.0, 2.0)["heading_rad"][0, 0])

    assert heading_deg(5.0, hovers=True) < 1.0
    assert heading_deg(0.0, hovers=True) == pytest.approx(6.0)
    assert heading_deg(5.0, hovers=False) == pytest.approx(6.0)
