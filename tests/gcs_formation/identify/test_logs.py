"""Logs of every format, written from a simulated vehicle, give its time constants; what isn't excited is said."""

from __future__ import annotations

import csv
import math

import numpy as np
import pytest

from airlink import mavlink as m
from airlink.clock import Instant
from airlink.frame import FrameWriter
from airlink.messages.system import Heartbeat
from airlink.messages.telemetry import Attitude, GlobalPositionInt, NavControllerOutput, VfrHud
from formation_scenario import load_scenario
from formation_scenario.vehicles import VehicleModel
from gcs_formation import identify as identification
from gcs_formation.errors import RecordError
from gcs_formation.identify import identify, report
from gcs_formation.identify.fitting import fit, flown_by_time_constants
from gcs_formation.identify.identifiability import TAUS
from gcs_formation.identify.initial_model import begin_with
from gcs_formation.identify.recording import STEP_S, Recording, recordings
from gcs_formation.record.tlog import TlogWriter
from gcs_formation.vehicle.velocity_setpoint import HEIGHT_S
from tests.gcs_formation.identify.log_bytes import Row, write_dataflash, write_ulog

PLANE = VehicleModel(tau_v_s=2.5, tau_psi_s=2.2, tau_ha_s=0.8, tau_hb_s=2.4)
COPTER = VehicleModel(
    hovers=True, tau_v_s=0.5, tau_psi_s=0.5, tau_ha_s=0.7, tau_hb_s=0.7, speed_min_mps=0.0, speed_max_mps=9.0,
    accel_max_mps2=5.0, turn_rate_max_rps=1.0,
)  # fmt: skip
BEGIN_S, STEPS_S = 30.0, 20.0
POINTS = 1100
COLUMNS = (
    "time_s,system,speed_setpoint_mps,heading_setpoint_deg,height_setpoint_m,mood,airspeed_mps,heading_deg,height_m"
)
AUTO, FBWB, CRUISE, MANUAL = 10, 6, 7, 0


def flight(model, moved=(2.0, 0.25, 6.0), speed_mps=22.0, ramp_s=0.0):
    """Return setpoints (3, K) that step each channel up and down by `moved`, and the motion (4, K) of a model."""
    at_s = STEP_S * np.arange(POINTS)
    commanded = np.repeat(np.array([[speed_mps], [0.3], [100.0]]), POINTS, axis=1)
    for row, size in enumerate(moved):
        for sign, later_s in ((1.0, 0.0), (-1.0, 12.0)):
            begin_s = later_s + STEPS_S + 28.0 * row
            corners = (begin_s, begin_s + ramp_s + 1e-6, begin_s + 12.0 - 1e-6, begin_s + 12.0 + ramp_s)
            commanded[row] += sign * size * np.interp(at_s, corners, (0.0, 1.0, 1.0, 0.0))
    begin = np.repeat(np.array([[speed_mps], [0.3], [100.0], [0.0]]), POINTS, axis=1)
    motion = flown_by_time_constants(Recording(1, begin, commanded), model)
    return commanded, np.vstack((motion, np.gradient(motion[2], STEP_S)[None]))


def times():
    return (BEGIN_S + STEP_S * np.arange(POINTS)).tolist()


def degrees(angle_rad):
    return math.degrees(math.remainder(angle_rad, math.tau))


def velocity(speed_mps, course_rad):
    return speed_mps * math.cos(course_rad), speed_mps * math.sin(course_rad)


def plane_dataflash(file, moved=(2.0, 0.25, 6.0), modes=((0.0, AUTO),), circles=False):
    """Write an ArduPlane's log without OFG: what its navigation commands, in these modes from these times on.

    While it `circles`, its bearing is that of the centre.
    """
    commanded, seen = flight(PLANE, moved)
    rows: list[Row] = [("MSG", 1.0, (b"ArduPlane V4.5.7 (2a3dc4b7)",)), ("PARM", 1.0, (b"SYSID_THISMAV", 4.0, 1.0))]
    rows += [("PARM", 1.0, (b"ROLL_LIMIT_DEG", 55.0, 45.0))]
    rows += [("MODE", begin_s, (number, number, 1)) for begin_s, number in modes]
    for at_s, (speed, bearing, height), (airspeed, course, alt, climb) in zip(
        times(), commanded.T.tolist(), seen.T.tolist(), strict=True
    ):
        north, east = velocity(airspeed, course)
        # The airspeed demand behind the limiter, and the height demand behind the filter, are something else.
        rows += [
            ("TECS", at_s, (alt, climb, height, (height + alt) / 2, 0.0, speed + 3.0, airspeed)),
            ("NTUN", at_s, (100.0, degrees(bearing), degrees(bearing + circles * math.pi / 2), speed)),
            ("ARSP", at_s, (0, airspeed)),
            ("ARSP", at_s, (1, 99.0)),
            ("XKF1", at_s, (0, 0.0, north, east, -climb)),
            ("XKF1", at_s, (1, 0.0, 0.0, 0.0, 0.0)),
        ]
    return write_dataflash(file, sorted(rows, key=lambda row: row[1]))


def copter_dataflash(file, kinds, metres=False, ramp_s=4.0):
    """Write an ArduCopter's log with GUIP (of 4.6 or of 4.7), or with PSCN, PSCE and PSCD."""
    commanded, seen = flight(COPTER, (1.0, 0.4, 6.0), 5.0, ramp_s)
    rows: list[Row] = [
        ("MSG", 1.0, (b"ArduCopter V4.6.0",)),
        ("MODE", 1.0, (4, 4, 1) if kinds == "GUIP" else (5, 5, 1)),
    ]
    for at_s, (speed, heading, height), (ground_mps, course, alt, climb) in zip(
        times(), commanded.T.tolist(), seen.T.tolist(), strict=True
    ):
        north, east = velocity(speed, heading)
        v_north, v_east = velocity(ground_mps, course)
        up = (height - alt) / HEIGHT_S
        rows += [("XKF1", at_s, (0, 0.0, v_north, v_east, -climb)), ("POS", at_s, (0, 0, alt, alt - 10.0))]
        setpoint = (north, east, -up) if metres else (100 * north, 100 * east, 100 * up)
        if kinds == "GUIP":
            rows.append(("GUIP", at_s, (4, 0.0, 0.0, 0.0, 0, *setpoint, 0.0, 0.0, 0.0)))
            continue
        rows += [
            ("PSCN", at_s, (0.0, 0.0, north, 99.0, v_north, 0.0)),
            ("PSCE", at_s, (0.0, 0.0, east, 99.0, v_east, 0.0)),
            ("PSCD", at_s, (-height, -alt, 0.0, 0.0, -climb, 0.0)),
        ]
    return write_dataflash(file, rows, metres)


def plane_ulog(file):
    commanded, seen = flight(PLANE)
    topics = {
        "vehicle_status": "uint8_t nav_state",
        "tecs_status": "float altitude_sp;float true_airspeed_sp;float true_airspeed_filtered",
        "npfg_status": "float lat_accel;float bearing",
        "vehicle_local_position": "float x;float y;float z;float vx;float vy;float vz;float ref_alt",
    }
    rows: list[Row] = [("vehicle_status", 1.0, (3,))]
    for at_s, (speed, bearing, height), (airspeed, course, alt, climb) in zip(
        times(), commanded.T.tolist(), seen.T.tolist(), strict=True
    ):
        north, east = velocity(airspeed, course)
        rows += [
            ("tecs_status", at_s, (height, speed, airspeed)),
            ("npfg_status", at_s, (0.0, math.remainder(bearing, math.tau))),
            ("vehicle_local_position", at_s, (0.0, 0.0, 40.0 - alt, north, east, -climb, 40.0)),
        ]
    return write_ulog(file, topics, rows, system=4)


def copter_ulog(file, ramp_s=4.0):
    commanded, seen = flight(COPTER, (1.0, 0.4, 6.0), 5.0, ramp_s)
    topics = {
        "vehicle_status": "uint8_t nav_state",
        "trajectory_setpoint": "float[3] position;float[3] velocity;float yaw",
        "vehicle_local_position": "float x;float y;float z;float vx;float vy;float vz;uint8_t xy_valid",
    }
    rows: list[Row] = [("vehicle_status", 1.0, (14,))]
    for at_s, (speed, heading, height), (ground_mps, course, alt, climb) in zip(
        times(), commanded.T.tolist(), seen.T.tolist(), strict=True
    ):
        setpoint = (*velocity(speed, heading), -(height - alt) / HEIGHT_S)
        rows += [
            ("trajectory_setpoint", at_s, (math.nan, math.nan, math.nan, *setpoint, 0.0)),
            ("vehicle_local_position", at_s, (0.0, 0.0, -alt, *velocity(ground_mps, course), -climb, 1)),
        ]
    return write_ulog(file, topics, rows, system=4)


def plane_tlog(file, mode=AUTO, kind=1):
    """Log an uncommanded ArduPlane: it reports its errors, heading in whole degrees, airspeed's in cm/s."""
    commanded, seen = flight(PLANE)
    log, vehicle = TlogWriter(file, 10**15), FrameWriter(4, 1)
    for tick, ((speed, bearing, height), (airspeed, course, alt, climb)) in enumerate(
        zip(commanded.T.tolist(), seen.T.tolist(), strict=True)
    ):
        at_s, (north, east) = STEP_S * tick, velocity(airspeed, course)
        for message in (
            Heartbeat(kind, 3, 0, mode),
            VfrHud(airspeed, airspeed, 0.0, 50, alt, climb),
            Attitude(at_s, 0.0, 0.0, course + 0.2, 0.0, 0.0, 0.0),
            GlobalPositionInt(at_s, 0.6, 2.1, alt, alt, north, east, -climb, 0.0),
            NavControllerOutput(0.0, 0.0, bearing, bearing, 100.0, height - alt, 100 * (speed - airspeed), 0.0),
        ):
            log.write(Instant(round(at_s * 1e9)), [vehicle.encode(message)])
    log.close()
    return file


def table(file, lacking=None):
    """Write the same flight of each vehicle, without the setpoints that it lacks: 0 to 2; of one that lacks none."""
    commanded, seen = flight(PLANE)
    with file.open("w", newline="") as opened:
        writer = csv.writer(opened)
        writer.writerow(COLUMNS.split(","))
        for at_s, (speed, heading, height), (airspeed, course, alt, _) in zip(
            times(), commanded.T.tolist(), seen.T.tolist(), strict=True
        ):
            for system, row in (lacking or {4: None}).items():
                setpoint = [
                    each if each_row != row else ""
                    for each_row, each in enumerate((speed, math.degrees(heading), height))
                ]
                writer.writerow([at_s, system, *setpoint, "fine", airspeed, math.degrees(course), alt])
    return file


LOGS = {
    "AUTO.BIN": (plane_dataflash, PLANE),
    "GUIDED.bin": (lambda file: copter_dataflash(file, "GUIP"), COPTER),
    "GUIDED in metres.bin": (lambda file: copter_dataflash(file, "GUIP", metres=True), COPTER),
    "LOITER.bin": (lambda file: copter_dataflash(file, "PSC"), COPTER),
    "GUIDED in steps.bin": (lambda file: copter_dataflash(file, "GUIP", ramp_s=0.0), COPTER),
    "plane.ulg": (plane_ulog, PLANE),
    "copter.ulg": (copter_ulog, COPTER),
    "plane.tlog": (plane_tlog, PLANE),
    "plane.csv": (table, PLANE),
}
OFTEN = {"AUTO.BIN", "plane.csv"}
"""What a push reads; the night reads all."""
SLOW = pytest.mark.slow


@pytest.mark.parametrize("name", [each if each in OFTEN else pytest.param(each, marks=SLOW) for each in LOGS])
def test_the_time_constants_that_were_simulated_are_found(name, tmp_path):
    write, true = LOGS[name]
    found = recordings(write(tmp_path / name))
    fitted = fit(found, begin_with(None, found))
    assert found[0].excited() == 3
    assert not fitted.unidentified
    assert fitted.model.hovers == true.hovers
    for lag in TAUS[:2]:
        assert fitted.estimates[lag].value == pytest.approx(getattr(true, lag), rel=0.12)
    height_s = sum(fitted.estimates[lag].value for lag in TAUS[2:])
    assert height_s == pytest.approx(true.tau_ha_s + true.tau_hb_s, rel=0.1)


@pytest.mark.parametrize("at_once", [1, 7, 10**6])
def test_a_log_is_read_whole_however_much_of_it_at_once(at_once, monkeypatch, tmp_path):
    log, kinds = str(plane_dataflash(tmp_path / "log.bin")), ("TECS", "NTUN")
    monkeypatch.setattr(m, "AT_ONCE", at_once)
    found = [kind for kind, _ in m.dataflash_messages(log, kinds)]
    assert found.count("TECS") == found.count("NTUN") == POINTS


@pytest.mark.parametrize("name", [name for name in LOGS if "GUIDED" not in name and name != "LOITER.bin"])
def test_the_vehicle_is_known_by_its_id(name, tmp_path):
    (found,) = recordings(LOGS[name][0](tmp_path / name))
    assert found.system == 4


@pytest.mark.parametrize(
    ("moved", "lacking", "said"),
    [
        pytest.param((0.0, 0.25, 6.0), "speed", "setpoint changed by no more than 0 m/s: found", marks=SLOW),
        pytest.param((2.0, 0.0, 6.0), "heading", "heading setpoint changed by no more than 0 rad", marks=SLOW),
        pytest.param((2.0, 0.25, 0.5), "height", "the height setpoint changed by no more than 1 m", marks=SLOW),
    ],
)
def test_an_axis_that_isnt_excited_is_said_and_the_others_are_given(moved, lacking, said, tmp_path):
    log = plane_dataflash(tmp_path / "log.bin", moved)
    found = identify(log, tmp_path / "mine.yaml")
    assert list(found["unidentified"]) == [lacking]
    assert said in found["unidentified"][lacking]
    for name, channel in zip(TAUS, ("speed", "heading", "height", "height"), strict=True):
        assert (name in found["lags"]) == (channel != lacking)
        if channel not in (lacking, "height"):
            assert found["lags"][name]["value"] == pytest.approx(getattr(PLANE, name), rel=0.12)
    assert f"not identified, {found['unidentified'][lacking]}; kept as declared" in report(found)
    assert (tmp_path / "mine.yaml").is_file()


def test_of_vehicles_that_lack_an_axis_each_all_are_found_and_which_they_have_is_said(tmp_path, monkeypatch):
    titles = list[str]()
    monkeypatch.setattr(
        identification, "save", lambda figure, _: titles.extend(each.get_title("right") for each in figure.axes)
    )
    log = table(tmp_path / "log.csv", {4: 0, 5: 2})
    found = identify(log, tmp_path / "mine.yaml")
    assert found["unidentified"] == {}
    assert found["channels"] == [["heading", "height"], ["speed", "heading"]]
    assert set(TAUS) <= set(found["lags"])
    assert list(found["residual_rms"]) == ["airspeed_mps", "heading_rad", "height_m"]
    assert list(found["flown_rms"]) == ["equation (7)"], "no flight has all that an airframe needs"
    assert list(found["flown_rms"]["equation (7)"]) == ["heading_rad", "height_m"]
    assert max(found["flown_rms"]["equation (7)"].values()) < 0.2
    assert titles == ["no setpoints in this recording", "", ""], "the figure is of the longer one"
    text = report(found)
    assert text.startswith("vehicles 4 (")
    assert " s of heading, height), 5 (" in text
    assert " s of speed, heading)" in text


def test_where_an_axis_is_lacking_the_declared_airframe_stays_and_the_equation_is_judged(tmp_path):
    path = {"waypoints_m": [[0, 0, 100], [3000, 0, 100]]}
    declared = load_scenario({"vehicles": {"count": 1, "model": "arduplane"}, "path": path})
    found = identify(table(tmp_path / "log.csv", {4: 2}), tmp_path / "mine.yaml", accepted=declared)
    assert list(found["unidentified"]) == ["height"]
    assert found["model"]["airframe"] == declared.vehicles[0].model.model_dump(exclude_none=True)["airframe"]
    assert list(found["flown_rms"]) == ["equation (7)"]
    assert "it flies as an aircraft" not in report(found)


@pytest.mark.slow
def test_a_steady_turn_identifies_no_lag():
    """Its lag looks as a constant offset does."""
    commanded, seen = flight(PLANE)
    commanded[:] = commanded[:, :1]
    commanded[1] += 0.05 * STEP_S * np.arange(POINTS)
    seen = np.vstack((flown_by_time_constants(Recording(1, seen, commanded), PLANE), np.zeros((1, POINTS))))
    seen[:3] += np.random.default_rng(1).standard_normal((3, POINTS)) * [[0.1], [0.02], [0.1]]
    with pytest.raises(RecordError, match=r"heading: [0-9]+% would be the standard deviation of its time constant"):
        fit([Recording(1, seen[:, 300:], commanded[:, 300:])], VehicleModel())


def test_a_mode_without_bearings_gives_airspeed_and_height(tmp_path):
    (found,) = recordings(plane_dataflash(tmp_path / "log.bin", modes=((0.0, FBWB),)))
    assert found.channels == ("speed", "height")
    assert found.modes == ("FLY_BY_WIRE_B",)


def test_setpoints_that_no_mode_follows_arent_used(tmp_path):
    (found,) = recordings(plane_dataflash(tmp_path / "log.bin", modes=((0.0, AUTO), (100.0, MANUAL))))
    assert found.modes == ("AUTO",)
    assert found.duration_s == pytest.approx(100.0 - BEGIN_S - 15.0, abs=0.5)
    with pytest.raises(RecordError) as refused:
        recordings(plane_dataflash(tmp_path / "log.bin", modes=((0.0, MANUAL),)))
    assert "found no vehicle under setpoints (ArduPlane, MANUAL 140 s, messages ARSP, NTUN, TECS, XKF1" in str(
        refused.value
    )
    assert "no messages OFG, GUIP, PSCN); allowed: 30 s or more with, of ArduPlane, OFG" in str(refused.value)


def test_the_bearing_isnt_flown_while_the_pilot_turns_in_cruise(tmp_path):
    """CRUISE leaves it as it was; this one is constant but for its steps, so airspeed and height are left."""
    (found,) = recordings(plane_dataflash(tmp_path / "log.bin", modes=((0.0, CRUISE),)))
    assert found.channels == ("speed", "height")


def test_the_bearing_of_a_circles_centre_isnt_flown(tmp_path):
    (found,) = recordings(plane_dataflash(tmp_path / "log.bin", circles=True))
    assert found.channels == ("speed", "height")


@pytest.mark.slow
def test_what_the_setpoints_identify_is_printed(tmp_path):
    text = report(identify(plane_dataflash(tmp_path / "log.bin"), tmp_path / "mine.yaml"))
    assert "setpoints: TECS and NTUN, in AUTO" in text
    assert "height as TECS received it; airspeed (NTUN's TAsp) before TECS' limits; heading: how L1 guidance" in text


def test_a_telemetry_log_without_setpoints_says_who_is_in_it(tmp_path):
    with pytest.raises(RecordError) as refused:
        recordings(plane_tlog(tmp_path / "flight.tlog", mode=MANUAL))
    assert "vehicle 4: ArduPlane, MANUAL 110 s, ATTITUDE, GLOBAL_POSITION_INT, NAV_CONTROLLER_OUTPUT, VFR_HUD" in str(
        refused.value
    )
    with pytest.raises(RecordError, match="vehicle 4: ArduCopter, mode 10 110 s"):
        recordings(plane_tlog(tmp_path / "copter.tlog", kind=2))


@pytest.mark.slow
def test_a_px4_without_the_shipped_ones_integrator_isnt_given_one(tmp_path):
    found = identify(plane_ulog(tmp_path / "plane.ulg"), tmp_path / "mine.yaml")
    assert "prompt_share" not in found["lags"]
    assert found["model"]["prompt_share"] == 1.0
    assert found["explained"]["airspeed_mps"] > 0.99


def test_a_px4_log_without_setpoints_says_what_it_has(tmp_path):
    topics = {
        "vehicle_status": "uint8_t nav_state",
        "vehicle_local_position": "float x;float y;float z;float vx;float vy;float vz",
    }
    rows: list[Row] = [("vehicle_status", 0.1 * tick, (0,)) for tick in range(600)]
    rows += [("vehicle_local_position", 0.1 * tick, (0.0,) * 6) for tick in range(600)]
    log = write_ulog(tmp_path / "manual.ulg", topics, rows)
    with pytest.raises(
        RecordError, match="PX4, MANUAL 60 s, topics vehicle_status, vehicle_local_position; without tecs"
    ):
        recordings(log)
    log.write_bytes(b"no log at all" * 10)
    with pytest.raises(RecordError, match="found no ULog file; allowed"):
        recordings(log)
    log.write_bytes(plane_ulog(tmp_path / "whole.ulg").read_bytes()[:-7])
    assert recordings(log)


@pytest.mark.parametrize(
    ("text", "said"),
    [
        ("a,b\n1,2\n", "found columns a, b, and no time_s; a table has a first line with names of columns"),
        ("", "found columns of no name, and no time_s"),
        ("time_s,airspeed_mps\n1,fast\n", "found 'fast' in column airspeed_mps of line 2, which isn't a number"),
        ("time_s,airspeed_mps\n1,20\n2,21\n", r"found no vehicle under setpoints \(columns time_s, airspeed_mps\)"),
    ],
)
def test_a_table_that_cant_be_read_is_refused(text, said, tmp_path):
    (tmp_path / "log.csv").write_text(text)
    with pytest.raises(RecordError, match=said):
        recordings(tmp_path / "log.csv")
