"""Recordings from telemetry logs, and the flight that is flown for them."""

import math
import random
import struct

import numpy as np
import pytest
from click.testing import CliRunner

import gcs_formation
from airlink.clock import Instant
from airlink.frame import FrameWriter
from airlink.messages.command import CommandInt
from airlink.messages.telemetry import Attitude, GlobalPositionInt, VfrHud
from formation_scenario import load_scenario
from formation_scenario.formation import Step, added
from gcs_formation.cli.identify import identify
from gcs_formation.errors import RecordError
from gcs_formation.identify.flown_steps import identification_scenario
from gcs_formation.identify.recording import SETTLING_S, STEP_S, _held, recordings
from gcs_formation.record.tlog import TlogWriter

PATH = {"waypoints_m": [[0, 0, 100], [4000, 2000, 120]]}


def logged(file, until_s=60.0, silent=(), system=3, told_every=1, turn_rps=0.1):
    """Log a vehicle with a commanded steady turn, at 10 Hz; speed and height setpoints each `told_every` ticks."""
    log, station, vehicle = TlogWriter(file, 10**15), FrameWriter(255, 190), FrameWriter(system, 1)
    for tick in range(round(until_s / 0.1)):
        at_s = tick * 0.1
        now = Instant(round(at_s * 1e9))
        if any(begin <= at_s < end for begin, end in silent):
            continue
        yaw = math.remainder(turn_rps * at_s, math.tau)
        for command, p2, z in ((43000, 23.0, 0.0), (43001, 0.0, 250.0), (43002, math.degrees(yaw) % 360.0, 0.0)):
            if command == 43002 or tick % told_every == 0:
                log.write(now, [station.encode(CommandInt(system, 1, 0, command, param2=p2, z=z))])
        log.write(now, [vehicle.encode(VfrHud(22.5, 22.0, 0.0, 50, 251.0, 0.5))])
        log.write(now, [vehicle.encode(Attitude(at_s, 0.0, 0.0, yaw, 0.0, 0.0, 0.0))])
        log.write(now, [vehicle.encode(GlobalPositionInt(at_s, 0.6, 2.1, 251.0, 51.0, 0.0, 0.0, -0.5, 0.0))])
    log.close()
    return file


def test_a_log_gives_what_was_reported_and_seen(tmp_path):
    (found,) = recordings(logged(tmp_path / "flight.tlog"), {3: 0.2})
    assert (found.system, found.delay_s) == (3, 0.2)
    assert found.duration_s == pytest.approx(60.0 - SETTLING_S, abs=0.5)
    assert found.commanded[[0, 2], 0] == pytest.approx([23.0, 250.0])
    assert found.seen[[0, 2, 3], 0] == pytest.approx([22.5, 251.0, 0.5], abs=1e-3)
    assert np.ptp(np.diff(found.seen[1])) < 1e-3
    assert found.seen[1, -1] - found.seen[1, 0] == pytest.approx(0.1 * (found.duration_s - STEP_S), abs=0.02)
    assert np.abs(found.commanded[1] - found.seen[1]).max() < 0.03


def test_a_setpoint_reported_within_a_step_counts_for_what_is_left_of_it():
    told = np.array([[0.0, 1.0], [0.53, 3.0], [2.0, 3.0]])
    assert _held(told, np.array([-0.05, 0.4, 0.5, 0.6, 2.0])) == pytest.approx([1.0, 1.0, 2.4, 3.0, 3.0])


def test_setpoints_that_are_commanded_again_each_second_or_so_break_no_recording(tmp_path):
    """Constant setpoints are repeated after a second and a tick, and one of these may be lost."""
    for told_every in (11, 22):
        (found,) = recordings(logged(tmp_path / f"{told_every}.tlog", told_every=told_every))
        assert found.duration_s == pytest.approx(60.0 - SETTLING_S, abs=2.5)


def test_places_ahead_are_courses_over_ground(tmp_path):
    """A fixed-wing PX4 with a crosswind drift, sent 400 m ahead to the north-east, finally to a circle."""
    log, station, vehicle = TlogWriter(tmp_path / "flight.tlog", 10**15), FrameWriter(255, 190), FrameWriter(3, 1)
    lat, lon = 0.6, 2.1
    ahead = 400.0 / 6371000.0 / math.sqrt(2.0)
    x, y = (round(math.degrees(each) * 1e7) for each in (lat + ahead, lon + ahead / math.cos(lat)))
    for tick in range(700):
        now, at_s = Instant(tick * 10**8), tick * 0.1
        log.write(now, [vehicle.encode(VfrHud(14.5, 14.0, 0.0, 50, 90.0, 0.5))])
        log.write(now, [vehicle.encode(Attitude(at_s, 0.0, 0.0, 0.5, 0.0, 0.0, 0.0))])
        log.write(now, [vehicle.encode(GlobalPositionInt(at_s, lat, lon, 90.0, 80.0, 10.0, 10.0, 0.0, 0.0))])
        speed, alt_m = (15.0, 95.0) if at_s < 60.0 else (-1.0, 120.0)
        log.write(now, [station.encode(CommandInt(3, 1, 0, 192, param1=speed, param2=1.0, x=x, y=y, z=alt_m))])
    log.close()
    (found,) = recordings(tmp_path / "flight.tlog")
    assert found.duration_s == pytest.approx(60.0 - SETTLING_S, abs=1.5)
    assert found.commanded[[0, 2]].min(axis=1) == pytest.approx([15.0, 95.0])
    assert found.commanded[[0, 2]].max(axis=1) == pytest.approx([15.0, 95.0])
    assert found.commanded[1] == pytest.approx(math.pi / 4, abs=0.01)
    assert found.seen[1] == pytest.approx(math.pi / 4)


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


@pytest.mark.parametrize(("speed_mps", "spacing_m", "kept_m"), [(5, 12, 15), (20, 30, 60), (20, 90, 90)])
def test_slots_are_three_seconds_of_flight_apart_or_as_far_as_the_scenario_has_them(speed_mps, spacing_m, kept_m):
    model = {"speed_min_mps": 2.0, "turn_rate_max_rps": 0.4}
    keys = {"vehicles": {"count": 3, "model": model}, "path": PATH | {"speed_mps": speed_mps}}
    flown = identification_scenario(load_scenario(keys | {"formation": {"spacing_m": spacing_m}}))
    assert flown.formation.spacing_m == pytest.approx(kept_m)


@pytest.mark.slow
def test_multirotors_that_fly_steps_are_said_to_do_as_they_are_reported(tmp_path):
    """A slot that swung by 30 degrees at 180 m was 50 m off, and its vehicle changed speed in the wrong direction."""
    flown = identification_scenario(load_scenario("configs/px4_copter.yaml", ["formation.shape=line"]))
    summary = gcs_formation.run(flown, clock="virtual", out=tmp_path / "run")
    events = (tmp_path / "run" / "events.jsonl").read_text(encoding="utf-8")
    assert '"disobeys"' not in events
    errors = [each["error_x_m"] for each in summary.to_dict()["followers"].values()]
    assert max(each["p95"] for each in errors) < 4.0
    assert summary.to_dict()["safety"]["min_separation_m"] > 12.0


def dataflash(file, until_s=60.0):
    """Write a vehicle's own log: FMT messages that define the others, then those, at 10 Hz."""
    layouts = {
        "PARM": (64, "QNff", "TimeUS,Name,Value,Default", "<Q16sff"),
        "OFG": (65, "QffffBffB", "TimeUS,Arsp,ArspA,Alt,AltA,AltF,Hdg,HdgA,AltL", "<QffffBffB"),
        "ARSP": (66, "Qf", "TimeUS,Airspeed", "<Qf"),
        "ATT": (67, "Qf", "TimeUS,Yaw", "<Qf"),
        "POS": (68, "Qf", "TimeUS,Alt", "<Qf"),
        "TECS": (69, "Qf", "TimeUS,dh", "<Qf"),
    }
    data = bytearray()

    def write(number, packed):
        data.extend(b"\xa3\x95" + bytes([number]) + packed)

    kinds = {"FMT": (128, "BBnNZ", "Type,Length,Name,Format,Columns", "<BB4s16s64s"), **layouts}
    for name, (number, kind, columns, packing) in kinds.items():
        length = 3 + struct.calcsize(packing)
        write(128, struct.pack("<BB4s16s64s", number, length, name.encode(), kind.encode(), columns.encode()))

    def tell(name, *values):
        number, _, _, packing = layouts[name]
        write(number, struct.pack(packing, *values))

    tell("PARM", 0, b"MAV_SYSID", 7.0, 1.0)
    for tick in range(round(until_s / 0.1)):
        at_s = 30.0 + 0.1 * tick
        yaw, at_us = math.remainder(0.1 * at_s, math.tau), round(at_s * 1e6)
        tell("OFG", at_us, 23.0, 1000.0, 250.0, 0.0, 0, yaw, 5.0, 0)
        for name, value in (("ARSP", 22.5), ("ATT", math.degrees(yaw) % 360.0), ("POS", 251.0), ("TECS", 0.5)):
            tell(name, at_us, value)
    file.write_bytes(bytes(data))
    return file


def test_a_vehicles_own_log_gives_the_same(tmp_path):
    (by_station,) = recordings(logged(tmp_path / "flight.tlog", system=7))
    (by_itself,) = recordings(dataflash(tmp_path / "00000001.BIN"))
    assert by_itself.system == by_station.system
    assert by_itself.commanded[[0, 2], 50] == pytest.approx(by_station.commanded[[0, 2], 50])
    assert by_itself.seen[[0, 2, 3], 50] == pytest.approx(by_station.seen[[0, 2, 3], 50], abs=1e-3)
    assert np.abs(by_itself.commanded[1] - by_itself.seen[1]).max() < 0.03


def test_the_command_says_what_is_missing(tmp_path):
    (tmp_path / "garbage.BIN").write_bytes(b"no log at all" * 100)
    logged(tmp_path / "still.tlog", turn_rps=0.0)
    for source, said in (
        ("garbage.BIN", "allowed"),
        ("still.tlog", "the speed setpoint changed by no more than 0 m/s"),
        ("still.tlog --vehicle 9", "--vehicle: found 9; allowed: 3"),
    ):
        name, *options = source.split()
        done = CliRunner().invoke(identify, [str(tmp_path / name), *options])
        assert done.exit_code == 2
        assert said in done.output


@pytest.mark.parametrize("there", ["mine.yaml", "mine.png"])
def test_files_that_are_there_are_replaced_only_if_reported_so(there, tmp_path):
    logged(tmp_path / "still.tlog", turn_rps=0.0)
    (tmp_path / there).write_text("mine")
    command = [str(tmp_path / "still.tlog"), "--out", str(tmp_path / "mine.yaml")]
    done = CliRunner().invoke(identify, command)
    assert done.exit_code == 2
    assert f"--out: found {tmp_path / there}; allowed: a file that isn't there yet, or --overwrite" in done.output
    assert (tmp_path / there).read_text() == "mine"
    assert "the speed setpoint changed by no more" in CliRunner().invoke(identify, [*command, "--overwrite"]).output


def test_nothing_is_flown_for_a_file_that_cannot_be_written(tmp_path):
    (tmp_path / "vehicle.yaml").write_text("mine")
    for out, said in (("vehicle.yaml", "found"), ("mine.png", "allowed: another ending than that of the figure")):
        command = ["configs/quickstart.yaml", "--out", str(tmp_path / out), "--run-dir", str(tmp_path / "run")]
        done = CliRunner().invoke(identify, command)
        assert done.exit_code == 2
        assert said in done.output
    assert not (tmp_path / "run").exists()


@pytest.mark.parametrize(
    ("data", "said"),
    [
        (
            random.Random(1).randbytes(5000),
            "found no vehicle under setpoints (no ArduPlane or ArduCopter, no mode, messages none; no messages OFG, "
            "TECS, NTUN, GUIP, PSCN); allowed: 30 s or more with, of ArduPlane, OFG",
        ),
        (b"\xa3\x95\x80\x80\x59" + 4 * b"?" + 16 * b"?" + 64 * b"?", "found not a dataflash log"),
    ],
)
def test_noise_is_refused_in_one_line(data, said, tmp_path, capfd):
    """pymavlink prints a line for each byte that it skips, and raises a plain Exception for unknown formats."""
    (tmp_path / "noise.bin").write_bytes(data)
    done = CliRunner().invoke(identify, [str(tmp_path / "noise.bin")])
    assert done.exit_code == 2
    assert said in done.stderr
    assert (len(done.stderr.splitlines()), done.stdout, capfd.readouterr()) == (1, "", ("", ""))


def test_a_message_that_lacks_a_field_is_named(tmp_path):
    log = dataflash(tmp_path / "00000001.BIN")
    log.write_bytes(log.read_bytes().replace(b"TimeUS,Yaw", b"TimeUS,Jaw"))
    with pytest.raises(
        RecordError, match="found a message ATT without 'Yaw'; allowed: a log as its autopilot writes it"
    ):
        recordings(log)
