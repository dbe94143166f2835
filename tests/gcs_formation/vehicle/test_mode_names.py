"""The names of modes: every mode of the dialect has one."""

from __future__ import annotations

import pytest

from airlink import mavlink as m
from airlink.messages.system import Heartbeat
from gcs_formation.vehicle.mode_names import COPTER, PLANE, PX4, px4_mode
from gcs_formation.view.log import name_of_mode


@pytest.mark.parametrize(("enum", "names"), [("PLANE_MODE", PLANE), ("COPTER_MODE", COPTER)])
def test_every_mode_of_ardupilot_has_its_name(enum: str, names: dict[int, str]) -> None:
    short = {"FLY_BY_WIRE_A": "FBWA", "FLY_BY_WIRE_B": "FBWB", "INITIALIZING": "INITIALISING"}
    told = {mode: m.name_of(enum, mode) for mode in range(40)}
    known = {mode: short.get(name, name) for mode, name in told.items() if not name.isdecimal() and name != "ENUM_END"}
    assert known == names


def test_modes_of_px4_are_those_of_its_header() -> None:
    assert PX4[px4_mode(4, 3)] == "HOLD"
    assert PX4[0x05040000] == "RTL"
    assert PX4[px4_mode(4, 18)] == "EXTERNAL8"
    assert len(set(PX4.values())) == len(PX4)


def test_a_quadplane_s_modes_are_those_of_planes() -> None:
    vtol = Heartbeat(m.MAV_TYPE_VTOL_DUOROTOR, m.MAV_AUTOPILOT_ARDUPILOTMEGA, 0, 19, m.MAV_STATE_ACTIVE)
    assert name_of_mode(vtol) == "QLOITER"
    assert name_of_mode(vtol.but(type=m.MAV_TYPE_FIXED_WING, custom_mode=5)) == "FBWA"
