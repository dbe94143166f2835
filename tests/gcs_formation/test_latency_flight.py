"""Delay and loss, injected and measured, in whole flights under the virtual clock."""

from __future__ import annotations

import json
from collections.abc import Callable
from typing import Any

import numpy as np
import pytest

from flight_model.earth import GeodeticOrigin
from gcs_formation.app.check_links import split_errors
from gcs_formation.budget.levels import LEVELS
from gcs_formation.budget.traffic import flight_hz
from gcs_formation.record.timeseries import flying
from gcs_formation.testing.flight_plan import Formation, Plan
from gcs_formation.testing.flown_flight import FlownFlight
from gcs_formation.vehicle.families.arduplane.arduplane import ArduPlane
from tests.processes import free_port

DELAYS_MS = (0, 50, 150, 300, 600)
DRIFTS_PPM = (0, 50, 15000)
SPEED_MPS = 22
ONE_FAST = ("uplink", *(pytest.param(way, marks=pytest.mark.slow) for way in ("both", "downlink")))
"""Directions of links that fail: all of them at night, one at each push."""


@pytest.fixture(scope="module")
def plan(tmp_path_factory: pytest.TempPathFactory) -> Callable[..., Plan]:
    """Plan a flight in the air along a straight line, with the given keys added or replaced."""

    def of(**keys: Any) -> Plan:
        plain: dict[str, Any] = {
            "duration_s": 40,
            "vehicles": {"count": 3},
            "start": {"in_air": True, "run_in_s": 10},
            "finish": {"loiter_s": 0},
            "formation": {"shape": "line", "spacing_m": 30},
            "path": {"speed_mps": SPEED_MPS, "waypoints_m": [[0, 0, 100], [SPEED_MPS * 400, 0, 100]]},
        }
        return Formation((), tmp_path_factory.mktemp("flights"))(plain | keys)

    return of


def difference_ms(link: Any) -> float:
    """Return measured minus realised one-way delay, relative to the allowed error: the larger of 2 ms and 2 %."""
    injected_ms = link["injected_delay_ms"]
    return (link["measured_delay_ms"]["p50"] - injected_ms) / max(2.0, 0.02 * injected_ms)


def grid(jitter_ms: float) -> tuple[list[dict[str, Any]], list[dict[str, Any]]]:
    """Return a leader and a follower for each delay and drift, and the followers' links."""
    vehicles: list[dict[str, Any]] = [{"id": 1, "role": "leader"}]
    links: list[dict[str, Any]] = []
    for delay_ms in DELAYS_MS:
        for drift_ppm in DRIFTS_PPM:
            vehicles.append({"id": len(vehicles) + 1, "clock": {"drift_ppm": drift_ppm}})
            jitter = {"jitter_ms": jitter_ms, "reorder": True}
            links.append({"at_s": 0, "vehicles": [len(vehicles)], "delay_ms": delay_ms} | jitter)
    return vehicles, links


@pytest.mark.slow
@pytest.mark.parametrize(("jitter_ms", "duration_s"), [(0, 20), (20, 150)])
def test_the_measured_delay_is_the_realised_one_whatever_the_clocks_drift(plan, jitter_ms, duration_s):
    """With 20 ms of jitter each way the median of 600 round trips is known to 0.7 ms."""
    vehicles, links = grid(jitter_ms)
    slow = {"rate_hz": 2}
    start = {"in_air": True, "run_in_s": 16, "timeout_s": 5}  # at 2 Hz over 600 ms no follower settles
    flight = plan(duration_s=duration_s, start=start, vehicles=vehicles, telemetry=slow, law=slow)
    flown = flight.with_keys(links={"changes": links}).fly()
    shares = {v["id"]: difference_ms(flown.link(v["id"])) for v in vehicles[1:]}
    assert max(map(abs, shares.values())) <= 1.0, shares


def test_both_ways_count_alike_in_the_injected_delay(plan):
    """Half a round trip is the mean of both directions, although twice as many datagrams go down as up."""
    flight = plan(duration_s=10, vehicles={"count": 2}).with_link(uplink={"delay_ms": 50}, downlink={"delay_ms": 250})
    link = flight.fly().link(2)
    assert link["injected_delay_ms"] == pytest.approx(150.0, abs=5.0)
    assert link["measured_delay_ms"]["p50"] == pytest.approx(150.0, abs=3.0)


@pytest.mark.slow
def test_unequal_ways_leave_the_constant_error_that_check_warns_of(plan):
    """320 ms more up than down map its clock 160 ms early: at 22 m/s it flies 3.52 m behind its slot."""
    flight = plan(duration_s=40).with_link(2, uplink={"delay_ms": 400}, downlink={"delay_ms": 80})
    flown = flight.fly()
    assert "3.52 m along the path (behind its slot" in next(split_errors(flown.scenario))
    series, link = flown.series(2), flown.link(2)
    settled = (series["mission_time_s"] > 30) & (series["mission_time_s"] < 40)
    assert series["error_x_m"][settled].mean() == pytest.approx(3.52, abs=0.1)
    assert (link["injected_up_ms"], link["injected_down_ms"]) == (pytest.approx(400), pytest.approx(80))
    assert (link["measured_up_ms"], link["measured_down_ms"]) == (None, None)  # round trips don't show the split


def test_a_step_of_delay_is_tracked_within_5_s(plan):
    series = plan(duration_s=13, vehicles={"count": 2}).with_link(2, from_s=5, delay_ms=300).fly().series(2)
    time_s, delay_s = series["mission_time_s"], series["delay_s"]
    assert np.abs(delay_s[(time_s > 1) & (time_s < 5)]).max() < 0.006
    assert np.abs(delay_s[time_s > 10] - 0.3).max() < 0.006


@pytest.mark.slow
def test_over_real_sockets_the_measured_delay_is_the_realised_one(plan):
    """Under the machine's clock: within 5 ms or 3 %, plus what the machine itself adds to a link without delay."""
    delays_ms = dict(enumerate((0, 50, 150, 300, 600), start=1))
    flight = plan(duration_s=10, vehicles={"count": 5, "endpoint": f"udpin:127.0.0.1:{free_port()}"}).in_real_time()
    for vehicle, delay_ms in delays_ms.items():
        flight = flight.with_link(vehicle, delay_ms=delay_ms, jitter_ms=5 if delay_ms else 0)
    flown = flight.fly()
    late_ms = flown.link(1)["measured_delay_ms"]["p99"]
    for vehicle, delay_ms in delays_ms.items():
        link = flown.link(vehicle)
        injected_ms = link["injected_delay_ms"]
        assert injected_ms == pytest.approx(delay_ms, abs=5.0 + late_ms)
        assert link["measured_delay_ms"]["p50"] == pytest.approx(
            injected_ms, abs=late_ms + max(5.0, 0.03 * injected_ms)
        )


def test_the_loss_on_the_way_up_is_reported_and_bounded_by_itself(plan):
    wanted = [{"metric": name, "followers": [2], "below": 0.1} for name in ("injected_loss_up", "injected_loss")]
    start = {"in_air": True, "timeout_s": 1}
    planned = plan(duration_s=15, vehicles={"count": 2}, start=start, expect=wanted)
    flown = planned.with_link(2, uplink={"loss": 0.3}).fly()
    link = flown.link(2)
    assert link["injected_loss_up"] == pytest.approx(0.3, abs=0.06)
    assert (link["injected_loss"], flown.link(1)["injected_loss_up"]) == (0.0, 0.0)
    assert [(each["value"], each["held"]) for each in flown.figures["expect"]] == [
        (link["injected_loss_up"], False),
        (0.0, True),
    ]


@pytest.mark.slow
@pytest.mark.parametrize("mean_burst", [None, 5])
def test_the_measured_loss_is_the_realised_one(plan, mean_burst):
    fast = {"rate_hz": 50}
    burst = {} if mean_burst is None else {"mean_burst": mean_burst}
    start = {"in_air": True, "run_in_s": 16}
    flown = plan(duration_s=80, start=start, vehicles={"count": 2}, telemetry=fast).with_link(loss=0.2, **burst).fly()
    link = flown.link(2)
    assert link["frames_in"] > 10_000
    assert link["injected_loss"] == pytest.approx(0.2, abs=0.02)
    assert link["measured_loss"] == pytest.approx(link["injected_loss"], abs=0.002)


BOTH, DOWN = {"outage": True}, {"downlink": {"outage": True}}


OUTAGES: dict[int, tuple[dict[str, Any], int]] = {2: (BOTH, 6), 3: (BOTH, 20), 4: (DOWN, 6), 5: (DOWN, 20)}
"""Followers' links: the direction that fails from 5 s on, and for how long."""


@pytest.fixture(scope="module")
def cut_off(plan) -> FlownFlight:
    """Fly with all of these links."""
    flight = plan(duration_s=30, vehicles={"count": 5})
    for follower, (way, outage_s) in OUTAGES.items():
        over = {key: {"outage": False} if isinstance(value, dict) else False for key, value in way.items()}
        flight = flight.with_link(follower, from_s=5, **way).with_link(follower, from_s=5 + outage_s, **over)
    return flight.fly()


@pytest.mark.parametrize("follower", OUTAGES)
def test_a_loss_is_measured_whether_or_not_the_vehicle_receives_us_meanwhile(cut_off, follower):
    """If it doesn't hear us it sends no answers: a third fewer frames, more than a round of sequence numbers."""
    link = cut_off.link(follower)
    assert link["injected_loss"] > 0.05
    assert link["measured_loss"] == pytest.approx(link["injected_loss"], abs=2e-4)


@pytest.mark.slow
def test_a_vehicle_that_hangs_behind_a_lossy_link_loses_nothing_by_that(plan):
    hangs = [{"kind": "freeze", "vehicles": [2], "at_s": 5, "until_s": 15}]
    link = plan(seed=5, vehicles={"count": 2}, faults=hangs).with_link(loss=0.05).fly().link(2)
    assert link["measured_loss"] == pytest.approx(link["injected_loss"], abs=1e-3)


@pytest.mark.slow
def test_what_comes_8_s_later_all_at_once_is_no_loss(plan):
    assert plan(vehicles={"count": 2}).with_link(2, from_s=5, delay_ms=8000).fly().link(2)["measured_loss"] == 0.0


@pytest.mark.slow
def test_a_link_that_dies_for_good_has_lost_what_the_vehicle_sends_by_itself(plan):
    """A vehicle that still receives us also answers, as can't be known; one that doesn't sends the rest alone.

    That is what was asked for, at the rates of flight, for 35 s.
    """
    plane = ArduPlane(2, GeodeticOrigin(0.0, 0.0, 0.0), 0.25)
    by_itself = 35.0 * sum(flight_hz(plane, LEVELS[0], plane.rates_hz(10.0)).values())
    both, down = (plan(vehicles={"count": 2}).with_link(2, from_s=5, **way).fly().link(2) for way in (BOTH, DOWN))
    assert down["injected_loss"] > both["injected_loss"] + 0.05
    for link in (both, down):
        assert link["measured_loss"] == pytest.approx(both["injected_loss"], abs=0.02)
    assert both["measured_loss"] == pytest.approx(by_itself / (by_itself + both["frames_in"]), abs=0.02)


def test_a_vehicle_that_is_to_fall_silent_has_a_link_without_loss(plan):
    kinds = {2: "crash", 3: "freeze"}
    faults = [{"kind": kind, "vehicles": [vehicle], "at_s": 5} for vehicle, kind in kinds.items()]
    flown = plan(duration_s=20, faults=faults).fly()
    assert [flown.link(vehicle)["measured_loss"] for vehicle in kinds] == [0.0, 0.0]


@pytest.mark.slow
def test_the_record_has_injected_delay_and_jitter_tick_by_tick(plan):
    """Over 60 s at 10 Hz the mean jitter is known to 4 %; it's the downlink's only."""
    jittery = plan(duration_s=60, vehicles={"count": 2}).with_link(2, uplink={"delay_ms": 50})
    flown = (
        jittery.with_link(2, downlink={"delay_ms": 150, "jitter_ms": 20, "reorder": True})
        .with_link(2, from_s=40, delay_ms=300)
        .fly()
    )
    clean, series = flown.series(1), flown.series(2)
    time_s = series["mission_time_s"]
    assert not clean["injected_delay_s"].any()
    assert np.nanmax(clean["jitter_s"]) < 0.001
    before, later = (time_s > 0) & (time_s < 39.9), time_s > 40.2
    assert series["injected_delay_s"][before].mean() == pytest.approx(0.1, abs=0.002)
    assert series["injected_delay_s"][later].mean() == pytest.approx(0.3, abs=0.004)
    assert series["jitter_s"][before].mean() == pytest.approx(0.02 * 2 / np.sqrt(np.pi), rel=0.12)
    assert flown.link(2)["jitter_ms"]["p50"] == pytest.approx(22.6, rel=0.12)


RECORD = ("flight.tlog", "timeseries.parquet", "events.jsonl")


def test_the_same_seed_gives_the_same_bytes_over_impaired_links(plan):
    impaired = plan(duration_s=3, vehicles={"count": 2}, start={"in_air": True, "run_in_s": 20}).with_link(
        delay_ms=80, jitter_ms=40, distribution="pareto", loss=0.1, mean_burst=3, duplicate=0.1, rate_kbps=500
    )
    one, again, other = impaired.fly(), impaired.fly(), impaired.with_keys(seed=2).fly()
    for name in RECORD:
        assert (one.directory / name).read_bytes() == (again.directory / name).read_bytes()
    assert (one.directory / "flight.tlog").read_bytes() != (other.directory / "flight.tlog").read_bytes()


@pytest.mark.slow
def test_a_change_on_one_link_leaves_the_other_links_delays_alone(plan):
    """Over links that lose a little every setpoint is sent on its tick: where only news are, their number varies."""
    lossy = {"delay_ms": 50, "jitter_ms": 20, "loss": 0.05}
    jittery = plan(duration_s=6, start={"in_air": True, "run_in_s": 6}).with_link(**lossy)
    before = jittery.fly().series(2)
    after = jittery.with_link(3, from_s=3, delay_ms=400, loss=0.3).fly().series(2)
    expected, found = (each["delay_s"][flying(each)] for each in (before, after))
    assert np.array_equal(expected, found, equal_nan=True)


@pytest.fixture(scope="module", params=ONE_FAST)
def outage(plan, request) -> FlownFlight:
    """Fly with follower 3's link down from 10 s to 20 s."""
    return plan(duration_s=38).with_outage(3, from_s=10, to_s=20, way=request.param).fly()


@pytest.mark.slow
def test_an_outage_of_one_link_disturbs_none_else(outage):
    outage.stays_within(0.05, followers=2)


@pytest.mark.slow
def test_after_an_outage_of_10_s_a_follower_rejoins(outage):
    assert not outage.series(3)["active"][outage.series(3)["mission_time_s"] == 18.0].any()
    outage.stays_within(0.5, followers=3, from_s=35)


@pytest.mark.slow
@pytest.mark.parametrize("way", ONE_FAST)
def test_an_outage_of_the_leaders_link_has_a_follower_lead_and_the_leader_follow_when_it_is_over(plan, way):
    cut = plan(duration_s=22, start={"in_air": True, "run_in_s": 6}).with_outage(1, from_s=5, to_s=15, way=way)
    flown = cut.fly()
    events = [json.loads(line) for line in (flown.directory / "events.jsonl").read_text().splitlines()]
    (begun_s,) = [event["t_s"] for event in events if event["text"] == "flying"]
    (leads,) = [event for event in events if event["kind"] == "leader"]
    assert leads["vehicle"] == "2"
    assert leads["t_s"] - begun_s == pytest.approx(8.0, abs=0.2)
    member = [event for event in events if event["kind"] == "member" and event["vehicle"] == "1"]
    assert member[-1]["text"] == "flying in formation"
    assert member[-1]["t_s"] - begun_s == pytest.approx(15.0, abs=0.6)
    away = [
        (event["vehicle"], event["text"]) for event in events if event["kind"] == "member" and event["t_s"] > begun_s
    ]
    assert away[0] == ("1", "told to loiter" if way == "uplink" else "not heard: told nothing until it is")
    assert {vehicle for vehicle, _ in away} == {"1"}
    uplink = [(event["vehicle"], event["t_s"] - begun_s) for event in events if event["kind"] == "uplink"]
    assert uplink == (
        [("1", pytest.approx(6.6, abs=0.3)), ("1", pytest.approx(15.1, abs=0.3))] if way == "uplink" else []
    )
    flown.keeps_apart(10.0)
