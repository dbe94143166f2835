"""When vehicles are asked for their time: four times a second, ten times while that pays."""

from __future__ import annotations

import math
from types import SimpleNamespace
from typing import Any

import numpy as np
import pytest

from airlink.clock import NANOSECONDS, Instant
from airlink.endpoint import VehicleId
from formation_scenario import load_scenario
from gcs_formation.fleet.heartbeats import HeartbeatScheduler
from gcs_formation.from_scenario import narrow_links
from gcs_formation.link.clock_sync import ClockSync
from gcs_formation.link.link_health import LinkState
from tests.flights.conftest import scenario

FIRST, SECOND = VehicleId(1, 1), VehicleId(1, 2)


def vehicle(identity: VehicleId, jitter_s: float, loss: float) -> Any:
    """Return a vehicle that answers each request at once, over delays that scatter."""
    rng, clock = np.random.default_rng(identity.system), ClockSync(0.02)

    def probe(now: Instant) -> Instant:
        up_s, down_s = 0.3 + jitter_s * rng.standard_normal(2)
        there = now + round((up_s + rng.uniform(0.0, 0.02)) * NANOSECONDS)
        clock.observe(now, there, Instant(there + round(down_s * NANOSECONDS)))
        return now

    received = SimpleNamespace(state=LinkState.CONNECTED)
    return SimpleNamespace(
        identity=identity,
        links=None,
        clock=clock,
        connection=received,
        probe=probe,
        sequence=SimpleNamespace(loss=loss),
    )


def asked_s(
    jitters_s: tuple[float, float], until_s: float, loss: float = 0.0, narrow: tuple[VehicleId, ...] = ()
) -> dict[VehicleId, list[float]]:
    """Return when each of two vehicles is asked, s."""
    vehicles = {each: vehicle(each, jitter_s, loss) for each, jitter_s in zip((FIRST, SECOND), jitters_s, strict=True)}
    schedule, found = HeartbeatScheduler(vehicles, lambda *_: None, narrow), {FIRST: [0.0], SECOND: [0.0]}
    while schedule.next_probe < until_s * NANOSECONDS:
        now = schedule.next_probe
        for asked, _ in schedule.probes(now):
            found[asked.identity].append(now / NANOSECONDS)
    return found


def rate_hz(times_s: list[float], since_s: float) -> float:
    late = [each for each in times_s if each >= since_s]
    return (len(late) - 1) / (late[-1] - late[0])


def test_a_quiet_link_is_probed_four_times_a_second() -> None:
    for times_s in asked_s((0.0, 0.001), 30.0).values():
        assert rate_hz(times_s, 0.0) == pytest.approx(4.0, rel=0.02)


def test_a_jittery_link_is_probed_ten_times_a_second_until_its_clock_is_known() -> None:
    """5 ms each way, with the wait for a loop: 0.25 ms of deviation are reached within five minutes."""
    times_s = asked_s((0.005, 0.0), 320.0)
    assert rate_hz([each for each in times_s[FIRST] if each < 15.0], 6.0) == pytest.approx(10.0, rel=0.02)
    assert rate_hz(times_s[FIRST], 300.0) == pytest.approx(4.0, rel=0.05)
    assert 3.0 < rate_hz([each for each in times_s[SECOND] if each < 15.0], 6.0) < 4.5


@pytest.mark.parametrize("kept", [{"loss": 0.05}, {"narrow": (FIRST, SECOND)}])
def test_a_link_that_may_be_full_is_not_loaded_with_more(kept: dict[str, Any]) -> None:
    assert rate_hz(asked_s((0.02, 0.02), 30.0, **kept)[FIRST], 0.0) == pytest.approx(4.0, rel=0.02)


@pytest.mark.parametrize("since_s", [0.05, 0.15, 0.26, 1.01, 3.33])
def test_one_that_is_received_between_two_others_requests_is_asked_with_the_next_common_ones(since_s: float) -> None:
    """It was in no list of those that are due yet, and the station ended by a KeyError."""
    vehicles = {FIRST: vehicle(FIRST, 0.02, 0.0), SECOND: vehicle(SECOND, 0.0, 0.0)}
    vehicles[SECOND].connection.state = LinkState.SEARCHING
    schedule, first_s = HeartbeatScheduler(vehicles, lambda *_: None), math.inf
    while schedule.next_probe < 6.0 * NANOSECONDS:
        now = schedule.next_probe
        if now >= since_s * NANOSECONDS:
            vehicles[SECOND].connection.state = LinkState.CONNECTED
        if any(asked.identity == SECOND for asked, _ in schedule.probes(now)):
            first_s = min(first_s, now / NANOSECONDS)
    assert since_s <= first_s < since_s + 0.4


def test_radios_links_of_limited_rate_and_serial_lines_are_narrow() -> None:
    limited = [{"at_s": 10, "vehicles": [3], "uplink": {"rate_kbps": 57.6}}]
    assert narrow_links(load_scenario(scenario(links={"changes": limited}))) == {VehicleId(1, 3)}
    assert not narrow_links(load_scenario(scenario()))
    radio = [{"vehicles": [1, 2], "rate_kbps": 57.6}]
    assert narrow_links(load_scenario(scenario(links={"channels": radio}))) == {VehicleId(1, 1), VehicleId(1, 2)}
    lines = [{"id": 1, "role": "leader"}, {"id": 2, "role": "follower", "endpoint": "serial:/dev/ttyUSB0:57600"}]
    assert narrow_links(load_scenario(scenario(vehicles=lines))) == {VehicleId(1, 2)}
