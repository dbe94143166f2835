"""A simulated vehicle is given the landing of its scenario, item by item as it requests them."""

from __future__ import annotations

import math
import socket
from pathlib import Path
from threading import Thread
from typing import Any

import pytest
from pymavlink.dialects.v20 import ardupilotmega

from airlink import mavlink as m
from airlink.clock import Instant
from airlink.endpoint import LOOPBACK, ComponentId
from airlink.messages.mission import MissionAck, MissionCount, MissionItemInt, MissionRequest, MissionRequestInt
from flight_model.earth import GeodeticOrigin
from gcs_formation.app.sitl.fleet import not_simulated, simulated
from gcs_formation.app.sitl.missions import Upload, give_mission, mission_of
from gcs_formation.app.sitl.simulator import SimulatorError
from gcs_formation.vehicle.stored_mission import LandingSequence, StoredMission
from tests.gcs_formation.app.sitl.test_fleet import PX4_PATH, fleet, planned
from tests.processes import LIMIT_S, free_port

PX4S = {"count": 2, "autopilot": "px4", "endpoint": "udpin:127.0.0.1:14550"}
ORIGIN = GeodeticOrigin(math.radians(35.0), math.radians(125.0), 0.0)
NOW = Instant(0)
GIVEN_TO = ComponentId(2, m.MAV_COMP_ID_AUTOPILOT1)
"""Whom the items are addressed to, and who reads them here."""


def given(**landing: float) -> tuple[MissionItemInt, ...]:
    """Return the items of the second PX4's mission."""
    return mission_of(2, fleet("px4", vehicles=PX4S | {"landing": landing}, path=PX4_PATH)[1].craft.landing)


def test_what_is_given_is_read_as_the_landing_of_the_scenario() -> None:
    upload, reader = (
        Upload(given(approach_m=700, height_m=45, course_deg=90)),
        StoredMission(2, GIVEN_TO, ORIGIN, needs_mark=True),
    )
    assert isinstance(upload.begins, MissionCount)
    reader.requests(NOW)
    reader.handle(upload.begins, NOW)
    while not reader.complete:
        (request,) = reader.requests(NOW)
        item = upload.answer(request)
        assert item is not None
        assert item.target_system == 2
        reader.handle(item, NOW)
    found = reader.landing(0.0)
    assert isinstance(found, LandingSequence)
    assert (math.degrees(found.course_rad), found.approach_m) == pytest.approx((90.0, 45.0), abs=0.01)


def test_it_is_over_when_the_vehicle_accepts_it() -> None:
    upload = Upload(given())
    assert upload.answer(MissionRequest(254, 190, 3)) is upload.answer(MissionRequestInt(254, 190, 3)) is not None
    assert upload.answer(MissionRequestInt(254, 190, 4)) is None, "there are four"
    upload.answer(MissionAck(254, 190, m.MAV_MISSION_ERROR, m.MAV_MISSION_TYPE_FENCE))
    assert not upload.over, "that is of its fence"
    upload.answer(MissionAck(254, 190, m.MAV_MISSION_ACCEPTED))
    assert upload.over


def test_a_vehicle_that_refuses_it_is_named() -> None:
    with pytest.raises(SimulatorError, match=r"vehicle 2: .* refused its mission \(MAV_MISSION_NO_SPACE\)"):
        Upload(given()).answer(MissionAck(254, 190, m.MAV_MISSION_NO_SPACE))


def vehicle_that_takes(link: socket.socket, taken: list[Any]) -> None:
    """Be PX4's side of the protocol, by pymavlink."""
    writer = ardupilotmega.MAVLink(None, srcSystem=2, srcComponent=1)
    count = -1
    while len(taken) != count:
        data, peer = link.recvfrom(2048)
        for message in writer.parse_buffer(data) or []:
            if message.get_type() == "MISSION_COUNT":
                count = message.count
            else:
                taken.append(message)
            wanted = writer.mission_request_int_encode(254, 190, len(taken))
            answer = writer.mission_ack_encode(254, 190, 0) if len(taken) == count else wanted
            link.sendto(answer.pack(writer), peer)


def test_a_mission_is_given_over_its_link_however_long_that_takes_on_this_machine() -> None:
    """Its time stands still meanwhile: it's the simulator's, not the machine's."""
    taken = list[Any]()
    with socket.socket(socket.AF_INET, socket.SOCK_DGRAM) as link:
        link.bind((LOOPBACK, 0))
        link.settimeout(LIMIT_S)
        vehicle = Thread(target=vehicle_that_takes, args=(link, taken))
        vehicle.start()
        give_mission(link.getsockname()[1], given(), lambda: 0.0)
        vehicle.join()
    assert [(each.seq, each.target_system) for each in taken] == [(seq, 2) for seq in range(len(given()))]


def test_one_that_takes_no_mission_in_a_minute_of_its_time_is_named() -> None:
    clock = iter(range(0, 1000, 10))
    with pytest.raises(SimulatorError, match="vehicle 2: its simulator took no mission within 60 s"):
        give_mission(free_port(), given(), lambda: float(next(clock)))
    assert next(clock) == 80


def test_what_a_simulator_can_not_do_is_said_in_a_line(tmp_path: Path) -> None:
    windy: dict[str, Any] = {"wind": {"velocity_mps": [3, 4, 0]}}
    noisy = {"navigation": {"source": "noisy"}}
    assert not_simulated(fleet("px4", vehicles=PX4S, path=PX4_PATH)) == []
    (line,) = not_simulated(fleet("px4", vehicles=PX4S | noisy, path=PX4_PATH, **windy))
    assert line == "px4 is flown without: navigation of source noisy, wind of 5 m/s"
    assert not_simulated(fleet(**windy)) == []
    (program := tmp_path / "px4").write_bytes(b"\0SIH_WIND_E\0SIH_WIND_N\0")
    each = simulated({"px4": program}, planned("px4", vehicles=PX4S, path=PX4_PATH, **windy), 1.0)
    assert not_simulated(each) == ["px4 is flown without: wind of 5 m/s"], "it would roll before its take-off"
    copters = {"vehicles": PX4S | {"model": "px4_copter"}, "path": PX4_PATH | {"speed_mps": 5}}
    each = simulated({"px4": program}, planned("px4", **copters, **windy), 1.0)
    assert not_simulated(each) == []
    from_mps = each[0].craft.parameters["SIH_WIND_N"], each[0].craft.parameters["SIH_WIND_E"]
    assert from_mps == (-3.0, -4.0), "it says where it comes from"
    gust = {"at_s": 3, "vehicles": "all", "velocity_mps": [1, 0, 0]}
    (line,) = not_simulated(fleet(disturbances=[gust], faults=[{"at_s": 5, "vehicles": [2], "kind": "crash"}]))
    assert line == "arduplane is flown without: disturbances, faults of vehicles"
