"""Logs of emulated vehicles: written in flight, fetched on the ground, read as ArduPilot's are."""

import json
from pathlib import Path
from typing import Any

import pytest

from airlink.clock import NANOSECONDS, Instant, RealClock, after
from airlink.endpoint import ComponentId, parse_endpoint
from airlink.engine import Datagram
from airlink.messages.command import LogEntry, LogRequestList
from airlink.stream_parser import StreamParser
from gcs_formation.identify.logs.dataflash import read_dataflash
from gcs_formation.log_fetch.by_ftp import FtpTransfer
from gcs_formation.log_fetch.fetch import ARMED, LogFetch
from gcs_formation.log_fetch.log_times import last_s
from gcs_formation.log_fetch.session import PART, LogFiles, _figures, _write
from gcs_formation.log_fetch.transfer import Stage
from sim_vehicles.autopilot.modes_and_failsafe import Request
from tests.flights.in_memory import Between, World

STATION = ComponentId(255, 25)


def flown(seconds: float, *, down: bool = True, between: type[Between] = Between, **keys: Any) -> World:
    """Fly two vehicles that write logs, then put them on the ground and disarm them."""
    world = World(
        between, vehicles={"count": 2, "onboard_log": True, **keys}, formation={"shape": "line", "spacing_m": 40}
    )
    world.run(seconds)
    for vehicle in world.fleet.vehicles if down else []:
        assert vehicle.pilot.request(Request.TOUCH_DOWN)
        vehicle.body.ground()
        assert vehicle.pilot.request(Request.DISARM)
    return world


def fetching(world: World, **given: Any) -> LogFetch:
    """Return a fetch that takes the station's place."""
    endpoints = world.station.endpoints()
    fetch = LogFetch(endpoints, {"1": (0, 1), "2": (0, 2)}, STATION, **given)
    world.process.replace(fetch)
    until = after(world.clock.now(), 60.0)
    world.network.run(lambda: fetch.over or world.clock.now() >= until)
    return fetch


@pytest.fixture(scope="module")
def fetched() -> tuple[World, LogFetch, dict[str, bytes]]:
    world = flown(8.0)
    fetch = fetching(world)
    content = {name: b"".join(each.transfer.chunks()) for name, each in fetch.wanted.items() if each.transfer}
    return world, fetch, content


def test_each_log_comes_byte_for_byte(fetched: tuple[World, LogFetch, dict[str, bytes]]) -> None:
    world, fetch, content = fetched
    assert all(each.over and not each.failure for each in fetch.wanted.values())
    for name, each in content.items():
        assert each == bytes(world.vehicle(int(name)).onboard_log.content)
        assert len(each) > 5000


def test_identify_reads_setpoints_and_motion_of_it(
    fetched: tuple[World, LogFetch, dict[str, bytes]], tmp_path: Path
) -> None:
    path = tmp_path / "vehicle-2.bin"
    path.write_bytes(fetched[2]["2"])
    track = next(each for each in read_dataflash(path).tracks if each.setpoints == "OFG")
    speeds = [value for _, value in track.of["speed"]]
    assert speeds[-1] == pytest.approx(fetched[0].vehicle(2).body.motion.airspeed_setpoint_mps, abs=3.0)
    assert [each.name for each in track.modes] == ["GUIDED"]
    assert {"yaw", "alt", "airspeed", "heading", "height"} <= set(track.of)


def test_its_clock_is_laid_beside_ours(fetched: tuple[World, LogFetch, dict[str, bytes]]) -> None:
    """By the shortest round trip: emulated vehicles booted at instant 0, up to their loop of 20 ms."""
    world, fetch, content = fetched
    for name, each in fetch.wanted.items():
        assert each.booted_s == pytest.approx(0.0, abs=0.025)
        written_s = last_s(content[name])
        assert written_s is not None
        assert 7.5 < written_s < world.clock.now() / NANOSECONDS


def test_an_armed_vehicle_sends_none_and_that_is_said() -> None:
    fetch = fetching(flown(2.0, down=False))
    assert [each.failure for each in fetch.wanted.values()] == [ARMED, ARMED]


def test_one_without_logs_says_so() -> None:
    fetch = fetching(flown(2.0, onboard_log=False))
    assert [each.transfer.failure for each in fetch.wanted.values() if each.transfer] == ["it has no logs"] * 2


class WithoutLogRequests(Between):
    """The vehicles get no LOG_REQUEST_LIST, as those whose firmware has none."""

    def take(self, datagram: Datagram, now: Instant) -> None:
        asked = [frame.message for frame in StreamParser().feed(datagram.data)]
        if not any(isinstance(each, LogRequestList) for each in asked):
            super().take(datagram, now)


def test_where_logs_cannot_be_requested_they_come_by_mavlink_ftp() -> None:
    world = flown(3.0, between=WithoutLogRequests)
    fetch = fetching(world, kept=lambda name, _: 500 if name == "2" else 0)
    for name, each in fetch.wanted.items():
        assert isinstance(each.transfer, FtpTransfer)
        assert (each.transfer.stage, each.failure) == (Stage.DONE, "")
        content = bytes(world.vehicle(int(name)).onboard_log.content)
        assert b"".join(each.transfer.chunks()) == content[500 if name == "2" else 0 :]


def test_one_that_is_not_there_is_named() -> None:
    fetch = LogFetch([parse_endpoint("udpin:127.0.0.1:14550")], {"9": (0, 9)}, STATION)
    for second in range(32):
        fetch.handle_timer(after(Instant(0), float(second)))
    assert fetch.wanted["9"].failure == "it wasn't heard at udpin:127.0.0.1:14550 in 30 s"


def test_a_part_is_kept_and_gone_on_with(tmp_path: Path) -> None:
    entry, files = LogEntry(5, 1, 5, 0, 10), LogFiles(tmp_path)
    assert files.kept("2", entry, ".bin") == 0
    files.add("2", [b"abcd", b"ef"])
    again = LogFiles(tmp_path)
    assert again.kept("2", entry, ".bin") == 6
    again.add("2", [b"ghij"])
    path = again.path("2", entry, ".bin")
    assert not path.is_file()
    again.finish("2")
    assert (path.name, path.read_bytes()) == ("vehicle-2-00000005.bin", b"abcdefghij")
    assert not path.with_name(path.name + PART).exists()
    assert LogFiles(tmp_path).kept("2", entry, ".bin") == 10
    assert LogFiles(tmp_path).kept("2", entry.but(size=12), ".bin") == 10  # it has grown since


def test_figures_tell_the_offset_or_why_not(fetched: tuple[World, LogFetch, dict[str, bytes]], tmp_path: Path) -> None:
    _, fetch, content = fetched
    files, clock = LogFiles(tmp_path), RealClock()
    each, entry = fetch.wanted["2"], LogEntry(1, 1, 1, 0, len(content["2"]))
    files.kept("2", entry, ".bin")
    files.add("2", [content["2"]])
    began_us = clock.utc_at_0_us - 40_000_000
    found = _figures(files, {"2": ".bin"}, "2", each, RealClock.at(Instant(20 * NANOSECONDS)), began_us)
    assert found["offset_s"] == pytest.approx(20.0, abs=0.1)  # the run began 40 s before, and the clock now shows 20 s
    restarted = _figures(files, {"2": ".bin"}, "2", each, RealClock.at(Instant(NANOSECONDS)), began_us)
    assert restarted["why"] == "the vehicle has restarted since the log was written"
    _write(files.folder, [found])
    _write(files.folder, [{"vehicle": "1", "failure": "x"}])
    assert {each["vehicle"] for each in json.loads((files.folder / "logs.json").read_text())} == {"1", "2"}
