"""Recordings out of telemetry logs, and the flight that is flown for them."""

import math

import numpy as np
import pytest

from airlink.clock import Instant
from airlink.frame import FrameWriter
from airlink.messages.command import CommandInt
from airlink.messages.telemetry import Attitude, GlobalPositionInt, VfrHud
from formation_scenario import load_scenario
from formation_scenario.steps import Step, added
from gcs_formation.errors import RecordError
from gcs_formation.identify.flight import identification_scenario
from gcs_formation.identify.recording import SETTLING_S, STEP_S, recordings
from gcs_formation.record.tlog import TlogWriter

PATH = {"waypoints_m": [[0, 0, 100], [4000, 2000, 120]]}


def logged(file, until_s=60.0, silent=(), system=3):
    """A log of a vehicle that turns steadily and is told so, at 10 Hz."""
    log, station, vehicle = TlogWriter(file, 10**15), FrameWriter(255, 190), FrameWriter(system, 1)
    for tick in range(round(until_s / 0.1)):
        at_s = tick * 0.1
        now = Instant(round(at_s * 1e9))
        if any(begin <= at_s < end for begin, end in silent):
            continue
        yaw = math.remainder(0.1 * at_s, math.tau)
        for command, p2, z in ((43000, 23.0, 0.0), (43001, 0.0, 250.0), (43002, math.degrees(yaw) % 360.0, 0.0)):
            log.write(now, station.encode(CommandInt(system, 1, 0, command, param2=p2, z=z)))
        log.write(now, vehicle.encode(VfrHud(22.5, 22.0, 0.0, 50, 251.0, 0.5)))
        log.write(now, vehicle.encode(Attitude(at_s, 0.0, 0.0, yaw, 0.0, 0.0, 0.0)))
        log.write(now, vehicle.encode(GlobalPositionInt(at_s, 0.6, 2.1, 251.0, 51.0, 0.0, 0.0, -0.5, 0.0)))
    log.close()
    return file


def test_a_log_gives_what_was_told_and_seen(tmp_path):
    (found,) = recordings(logged(tmp_path / "flight.tlog"), {3: 0.2})
    assert (found.system, found.delay_s) == (3, 0.2)
    assert found.duration_s == pytest.approx(60.0 - SETTLING_S, abs=0.5)
    assert found.told[[0, 2], 0] == pytest.approx([23.0, 250.0])
    assert found.seen[[0, 2, 3], 0] == pytest.approx([22.5, 251.0, 0.5], abs=1e-3)
    assert np.ptp(np.diff(found.seen[1])) < 1e-3
    assert found.seen[1, -1] - found.seen[1, 0] == pytest.approx(0.1 * (found.duration_s - STEP_S), abs=0.02)
    assert np.abs(found.told[1] - found.seen[1]).max() < 0.03


def test_the_longest_stretch_without_a_gap_counts(tmp_path):
    (found,) = recordings(logged(tmp_path / "flight.tlog", until_s=90.0, silent=[(30.0, 33.0)]))
    assert found.duration_s == pytest.approx(57.0, abs=1.0)


@pytest.mark.parametrize("until_s", [0.0, 20.0])
def test_a_log_without_enough_is_refused(tmp_path, until_s):
    with pytest.raises(RecordError, match="found no vehicle under setpoints"):
        recordings(logged(tmp_path / "flight.tlog", until_s=until_s))


def test_a_missing_log_is_refused(tmp_path):
    with pytest.raises(RecordError, match="No such file"):
        recordings(tmp_path / "none.tlog")


def test_steps_come_and_go():
    steps = [Step(at_s=10, for_s=10, speed_mps=2.0), Step(at_s=15, for_s=10, ramp_s=4.0, height_m=8.0)]
    assert added(steps, math.nan) == (0.0, 0.0, 0.0)
    assert added(steps, 12.0) == (2.0, 0.0, 0.0)
    assert added(steps, 17.0) == (2.0, 0.0, 4.0)
    assert added(steps, 24.0) == (0.0, 0.0, 2.0)
    assert added([Step(at_s=0, for_s=1, heading_deg=90 / 2)], 0.5)[1] == pytest.approx(math.pi / 4)


def test_the_flight_for_identification_is_straight_and_within_the_limits():
    scenario = load_scenario(
        {
            "vehicles": {"count": 3, "model": "arduplane"},
            "path": PATH | {"speed_mps": 27.0},
            "orders": [{"at_s": 10, "order": "loiter"}],
            "expect": [{"metric": "error_x_m.max", "below": 0.01}],
        }
    )
    flown = identification_scenario(scenario)
    assert not flown.orders
    assert not flown.expect
    assert flown.vehicles == scenario.vehicles
    assert flown.law == scenario.law
    fastest = max(27.0 + added(flown.path.steps, at_s)[0] for at_s in np.arange(0.0, flown.duration_s, 0.5).tolist())
    assert 27.5 < fastest < scenario.vehicles[0].model.speed_max_mps
    moved = np.array(
        [[getattr(step, name) for name in ("speed_mps", "heading_deg", "height_m")] for step in flown.path.steps]
    )
    assert (moved.max(axis=0) > 0).all()
    assert moved.sum(axis=0) == pytest.approx([0.0, 0.0, 0.0])
    directions = np.diff(np.array(flown.path.waypoints_m)[:, :2], axis=0)
    headings = np.arctan2(directions[:, 1], directions[:, 0])
    assert np.ptp(headings) < 1e-6
