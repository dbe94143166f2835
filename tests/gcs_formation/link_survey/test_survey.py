"""A survey finds what an emulated link does, in memory under the virtual clock."""

from __future__ import annotations

import csv
import io
import math
import struct
from collections import Counter
from pathlib import Path
from typing import Any

import numpy as np
import pytest
import yaml

from airlink import mavlink as m
from airlink.clock import Instant, VirtualClock, after
from airlink.delay_distribution import QUANTILE
from airlink.endpoint import Address, VehicleId, parse_endpoint
from airlink.engine import MemoryNetwork
from airlink.frame import Frame
from airlink.impaired_link import ImpairedEngine
from airlink.impairment import Impairment
from airlink.stream_parser import StreamParser
from formation_scenario import load_scenario
from gcs_formation.link_survey import report
from gcs_formation.link_survey.meaning import foretold, meaning, parts, rehearsal
from gcs_formation.link_survey.radio import RadioReports
from gcs_formation.link_survey.survey import LinkSurvey
from sim_vehicles.config import fleet_config
from sim_vehicles.fleet import Fleet
from tests.flights.conftest import scenario

LINKS = {
    1: (Impairment(0.120, 0.015, loss=0.05), Impairment(0.120, 0.015, loss=0.08, mean_burst=3.0)),
    2: (Impairment(0.250, 0.030, "uniform"), Impairment(0.250, 0.030, "uniform", loss=0.02)),
    3: (Impairment(), Impairment()),
}
NETWORK = 1


class Surveyed:
    """A survey of three emulated vehicles."""

    def __init__(self, seconds: float = 240.0, load_kbps: float | None = None, **keys: Any) -> None:
        planned = load_scenario(scenario(**{"vehicles": {"count": 3}, **keys}))
        ports = [
            parse_endpoint(each) for each in dict.fromkeys(text for each in planned.vehicles for text in each.endpoints)
        ]
        self.survey = LinkSurvey(ports, after(Instant(0), seconds), 10.0, load_kbps)
        networks = [NETWORK] * len(ports)
        self.impaired = ImpairedEngine(self.survey, networks, lambda vehicle, _: LINKS[vehicle.system], 1)
        self.clock = VirtualClock()
        network = MemoryNetwork(self.clock)
        network.attach(self.impaired)
        network.attach(Fleet(fleet_config(planned)))
        network.run(lambda: self.clock.now() >= self.survey.over)
        self.found = report.figures(self.survey, self.clock.now())

    def vehicle(self, system: int) -> dict[str, Any]:
        return self.found["vehicles"][str(system)]

    def injected(self, system: int) -> tuple[Any, Any]:
        return self.impaired.statistics(VehicleId(NETWORK, system))


@pytest.fixture(scope="module")
def surveyed() -> Surveyed:
    return Surveyed()


@pytest.mark.parametrize("system", [1, 2])
def test_delay_and_jitter_are_those_of_the_link_within_a_twentieth(surveyed: Surveyed, system: int) -> None:
    delay = surveyed.vehicle(system)["delay_ms"]
    for way, planned in zip(("up", "down"), LINKS[system], strict=True):
        assert delay[way]["mean"] == pytest.approx(1e3 * planned.delay_s, rel=0.05)
        assert delay[way]["jitter"] == pytest.approx(1e3 * planned.jitter_s, rel=0.05)
    planned_ms = 1e3 * np.hypot(LINKS[system][0].jitter_s, LINKS[system][1].jitter_s)
    assert delay["round_trip"]["mean"] == pytest.approx(2e3 * LINKS[system][0].delay_s, rel=0.02)
    assert delay["round_trip"]["jitter"] == pytest.approx(planned_ms, rel=0.05)


@pytest.mark.parametrize(("system", "like"), [(1, "normal"), (2, "uniform")])
def test_percentiles_are_those_of_the_distribution(surveyed: Surveyed, system: int, like: str) -> None:
    delay, planned = surveyed.vehicle(system)["delay_ms"]["down"], LINKS[system][1]
    for name, share in (("p50", 0.5), ("p95", 0.95), ("p99", 0.99)):
        expected_ms = 1e3 * (planned.delay_s + planned.jitter_s * QUANTILE[like](share))
        assert delay[name] == pytest.approx(expected_ms, rel=0.05)
    assert delay["like"] == like


def test_of_jitter_one_delay_tells_nothing_of_the_next_one(surveyed: Surveyed) -> None:
    for system in (1, 2):
        assert abs(surveyed.vehicle(system)["delay_ms"]["down"]["correlation"]) < 0.1
    slow = np.array([0.1 + 0.05 * math.sin(0.2 * number) for number in range(400)])
    assert report._spread(slow)["correlation"] == pytest.approx(math.cos(0.2), abs=0.01)


def test_a_link_without_delay_has_none_though_its_vehicle_answers_in_a_loop(surveyed: Surveyed) -> None:
    delay = surveyed.vehicle(3)["delay_ms"]
    assert max(delay[way][name] for way in ("up", "down", "round_trip") for name in ("mean", "jitter", "p99")) < 0.1


@pytest.mark.parametrize("system", [1, 2, 3])
def test_losses_are_those_that_the_link_made(surveyed: Surveyed, system: int) -> None:
    """Counted, they are the realised ones: up by what is missing of round trips, down by sequence numbers."""
    loss = surveyed.vehicle(system)["loss"]
    up, down = surveyed.injected(system)
    assert loss["down"] == pytest.approx(down.loss, rel=0.05, abs=1e-3)
    assert loss["up"] == pytest.approx(up.loss, rel=0.05, abs=3e-3)


def test_bursts_are_reported_from_single_losses(surveyed: Surveyed) -> None:
    assert surveyed.vehicle(1)["bursts"]["down"]["mean"] == pytest.approx(3.0, rel=0.15)
    assert surveyed.vehicle(2)["bursts"]["down"]["mean"] == pytest.approx(1.0, abs=0.1)


def test_a_clock_that_drifts_is_seen_to() -> None:
    clock = {"offset_s": 12.5, "drift_ppm": 35.0}
    vehicles = [
        {"id": 1, "role": "leader", "clock": clock},
        {"id": 2, "role": "follower"},
        {"id": 3, "role": "follower"},
    ]
    found = Surveyed(120.0, vehicles=vehicles).vehicle(1)["clock"]
    assert found["drift_ppm"] == pytest.approx(35.0, abs=4.0 * found["drift_deviation_ppm"])
    assert found["drift_deviation_ppm"] < 13.0  # 1.5 times the bound
    assert found["offset_s"] == pytest.approx(12.5 + 120.0 * 35e-6, abs=4e-3)


def test_a_trace_has_every_request_at_its_time_and_an_empty_cell_for_a_loss(surveyed: Surveyed) -> None:
    survey = surveyed.survey
    (link,) = (each for (_, system), each in survey.links.items() if system == 1)
    found = surveyed.vehicle(1)
    rows = list(csv.DictReader(io.StringIO(report.trace(link, found["loss"], survey.until))))
    times_s = np.array([float(row["t_s"]) for row in rows])
    assert times_s[0] == 0.0
    assert np.median(np.diff(times_s)) == pytest.approx(0.1, abs=0.01)
    for way in ("up", "down"):
        lost = np.mean([not row[f"{way}_ms"] for row in rows])
        known_ms = [float(row[f"{way}_ms"]) for row in rows if row["rtt_ms"]]
        assert lost == pytest.approx(found["loss"][way], rel=0.2)
        assert np.mean(known_ms) == pytest.approx(found["delay_ms"][way]["mean"], rel=1e-3)
    assert np.mean([not row["rtt_ms"] for row in rows]) == pytest.approx(found["loss"]["round_trip"], abs=1e-4)


@pytest.mark.parametrize("rate_kbps", [9.6, 19.2])
def test_what_a_link_carries_is_found_by_filling_it(monkeypatch: pytest.MonkeyPatch, rate_kbps: float) -> None:
    """Rates are tried in steps of 1.4, and telemetry, 5 kbit/s, shares the way down."""
    narrow = Impairment(rate_bps=1e3 * rate_kbps)
    for system in LINKS:
        monkeypatch.setitem(LINKS, system, (narrow, narrow))
    found = Surveyed(20.0, load_kbps=60.0).found["vehicles"].values()
    (capacity,) = (each["capacity_kbps"] for each in found if each["capacity_kbps"])  # one vehicle at each endpoint
    assert capacity["full_above"]
    assert (rate_kbps - 6.0) / 1.4 < capacity["each_way"] < rate_kbps


def test_nothing_is_commanded_and_no_failsafe_waits_for_its_heartbeats() -> None:
    sent = Counter[int]()
    survey = Surveyed(3.0).survey
    again = LinkSurvey(survey.endpoints(), after(Instant(0), 5.0), 10.0)
    for socket, system in survey.links:
        again.links[socket, system] = survey.links[socket, system]
        again._at[socket, system] = Address("127.0.0.1", 1)
        again._peers[socket][Address("127.0.0.1", 1)] = None
    while (now := again.next_timer()) is not None and now < again.over:
        again.handle_timer(now)
        for datagram in again.datagrams_to_send():
            for frame in StreamParser().feed(datagram.data):
                sent[frame.message_id] += 1
                assert frame.system not in {0, 255}
    assert set(sent) == {m.MAVLINK_MSG_ID_HEARTBEAT, m.MAVLINK_MSG_ID_TIMESYNC}


def test_a_radio_reports_its_signal() -> None:
    """RADIO_STATUS as SiK sends it, with its last field cut off, which is 0."""
    payload = struct.pack("<HHBBBBB", 7, 3, 180, 171, 96, 45, 0)[:-1]
    radio = RadioReports()
    for errors in (7, 9):
        raw = b"\xfd" + bytes((len(payload), 0, 0, 0, 51, 68, 109, 0, 0)) + bytes((errors, 0)) + payload[2:] + b"\0\0"
        radio.receive(Frame(51, 68, 0, 109, 2, None, raw))
    found = radio.figures()
    assert found is not None
    assert (found["rssi"]["p50"], found["remote_rssi"]["worst"], found["txbuf_percent"]["worst"]) == (180, 171, 96)
    assert (found["noise"]["worst"], found["remote_noise"]["p50"], found["errors"], found["reports"]) == (45, 0, 2, 2)


@pytest.mark.slow
def test_what_a_rehearsal_foretells_is_what_is_flown_over_the_link(surveyed: Surveyed, tmp_path: Path) -> None:
    """Foretold by the survey, flown over the impairments themselves: the rms of as many flights each."""
    for (_, system), link in surveyed.survey.links.items():
        file = f"trace-{system}.csv"
        text = report.trace(link, surveyed.vehicle(system)["loss"], surveyed.survey.until)
        report.write(text, tmp_path / file)
        surveyed.vehicle(system)["trace"] = file
    means = meaning(surveyed.found, tmp_path)
    assert means is not None
    assert means["flies"]
    planned = yaml.safe_load((tmp_path / "rehearsal.yaml").read_text(encoding="utf-8"))
    order = sorted(LINKS, key=lambda system: -LINKS[system][0].delay_s)
    changes = [
        {"at_s": 0, "vehicles": [number]}
        | {
            f"{way}link": {
                "delay_ms": 1e3 * each.delay_s,
                "jitter_ms": 1e3 * each.jitter_s,
                "distribution": each.distribution,
                "loss": each.loss,
                "mean_burst": each.mean_burst,
            }
            for way, each in zip(("up", "down"), LINKS[system], strict=True)
        }
        for number, system in enumerate(order, 1)
    ]
    true = planned | {"links": {"changes": changes}}
    (tmp_path / "true.yaml").write_text(yaml.safe_dump(true), encoding="utf-8")
    flown = foretold(parts(load_scenario(tmp_path / "true.yaml"), 240.0))
    assert flown["rms_m"] == pytest.approx(means["rms_m"], rel=0.3)


def test_each_flight_of_a_rehearsal_begins_at_another_part_of_the_record(surveyed: Surveyed, tmp_path: Path) -> None:
    """Replayed from its beginning it would be the same link each time, and one flight as good as six."""
    vehicles = surveyed.found["vehicles"]
    for (_, system), link in surveyed.survey.links.items():
        file = tmp_path / f"trace-{system}.csv"
        report.write(report.trace(link, surveyed.vehicle(system)["loss"], surveyed.survey.until), file)
        vehicles[str(system)]["trace"] = str(file)
    begins_s = [
        {
            way.trace.begin_s
            for change in each.links.changes
            for way in (change.uplink, change.downlink)
            if way is not None and way.trace is not None
        }
        for each in parts(load_scenario(rehearsal(vehicles, 10.0)), 240.0)
    ]
    assert begins_s == [{0.0}, {40.0}, {80.0}, {120.0}, {160.0}, {200.0}]
