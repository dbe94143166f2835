"""Which messages are requested again, by counts of what arrived; without a flight."""

from __future__ import annotations

import math
from collections import Counter
from itertools import pairwise
from types import SimpleNamespace
from typing import Any

import numpy as np
import pytest

from airlink import mavlink as m
from airlink.clock import NANOSECONDS, Instant, after
from airlink.endpoint import VehicleId
from airlink.messages import KINDS
from airlink.messages.command import CommandAck
from flight_model.earth import GeodeticOrigin
from gcs_formation.features.message_intervals.requested_again import ASK_AGAIN_S, MessageIntervals
from gcs_formation.link.frame_loss import STALE_AFTER_S
from gcs_formation.link.link_health import Connection, LinkState
from gcs_formation.vehicle.command_delivery import CommandQueue
from gcs_formation.vehicle.families.arduplane.arduplane import ArduPlane
from tests.gcs_formation.event_log import EventLog

ATTITUDE, AIRSPEED, HEARTBEAT = m.MAVLINK_MSG_ID_ATTITUDE, m.MAVLINK_MSG_ID_VFR_HUD, m.MAVLINK_MSG_ID_HEARTBEAT
STATUS = m.MAVLINK_MSG_ID_SYS_STATUS
ORIGIN = GeodeticOrigin(math.radians(35.0), math.radians(125.0), 0.0)
ASKED_HZ = {ATTITUDE: 10.0, AIRSPEED: 10.0, STATUS: 2.0, HEARTBEAT: 1.0}
STEP_S = 0.1


class Sender:
    """A vehicle that sends at given rates over a link with random loss."""

    def __init__(self) -> None:
        self.rates_hz, self.loss, self.answer = dict(ASKED_HZ), 0.0, m.MAV_RESULT_ACCEPTED
        self.vehicle: Any = SimpleNamespace(
            identity=VehicleId(1, 2),
            rates_hz=ASKED_HZ,
            messages_in=[0] * len(KINDS),
            sequence=SimpleNamespace(received=0, lost=0),
            start_up=SimpleNamespace(asked_for_telemetry=True),
            connection=Connection(0, state=LinkState.CONNECTED),
            commands=CommandQueue(),
            autopilot=ArduPlane(2, ORIGIN, 0.25),
        )
        self.logged, self.now = EventLog(), Instant(0)
        self.asked: list[tuple[float, int, float]] = []
        """When each message was requested, its id, and its interval in s."""
        self._due, self._random = Counter[int](), np.random.default_rng(1)
        vehicles: dict[Any, Any] = {self.vehicle.identity: self.vehicle}
        self._watch = MessageIntervals(vehicles, self.logged)

    def run(self, seconds: float, *, silent: bool = False) -> None:
        for _ in range(round(seconds / STEP_S)):
            self.now = after(self.now, STEP_S)
            if not silent:
                self._send()
            self._watch.check_all(self.now)
            while (command := self.vehicle.commands.due(self.now)) is not None:
                self.asked.append((self.now / NANOSECONDS, int(command.param1), command.param2 * 1e-6))
                self.vehicle.commands.acknowledge(CommandAck(command.command, self.answer), self.now)

    def _send(self) -> None:
        for message_id, rate_hz in self.rates_hz.items():
            self._due[message_id] += round(rate_hz * STEP_S * 1000)
            if self._due[message_id] >= 1000:
                self._due[message_id] -= 1000
                arrives = bool(self._random.random() >= self.loss)
                self.vehicle.sequence.received += arrives
                self.vehicle.sequence.lost += not arrives
                self.vehicle.messages_in[KINDS[message_id].index] += arrives


@pytest.fixture
def sender() -> Sender:
    """Return a vehicle that has sent what was requested for 5 s."""
    sends = Sender()
    sends.run(5.0)
    return sends


@pytest.mark.parametrize(("loss", "seconds"), [(0.0, 30.0), (0.5, 1000.0), (0.7, 100.0)])
def test_nothing_is_asked_of_one_that_sends_as_asked_whatever_its_link_loses(loss: float, seconds: float) -> None:
    sends = Sender()
    sends.loss = loss
    sends.run(seconds)
    assert sends.asked == sends.logged == []


@pytest.mark.parametrize("rate_hz", [0.0, 4.0])
def test_a_message_that_comes_less_than_half_as_often_is_asked_for_and_no_other(sender: Sender, rate_hz: float) -> None:
    sender.rates_hz[ATTITUDE] = rate_hz
    sender.run(4.5)
    ((asked_s, message_id, interval_s), *_) = sender.asked
    assert 5.0 + 1.0 < asked_s < 5.0 + 3.0
    assert (message_id, interval_s) == (ATTITUDE, pytest.approx(0.1))
    assert sender.logged.of("streams", 2) == [
        "sends ATTITUDE less than half as often as asked for, or not at all; it is asked again"
    ]
    assert {each for _, each, _ in sender.asked} == {ATTITUDE}


def test_a_message_that_comes_more_than_half_as_often_is_left_alone(sender: Sender) -> None:
    sender.rates_hz[ATTITUDE] = 6.0
    sender.run(20.0)
    assert sender.asked == []


@pytest.mark.parametrize(("message_id", "counted_s"), [(AIRSPEED, 2.0), (STATUS, 8.0)])
def test_a_message_that_comes_again_is_said_to_once_it_has_been_counted_anew(
    sender: Sender, message_id: int, counted_s: float
) -> None:
    sender.run(5.0)
    sender.rates_hz[message_id] = 0.0
    while not sender.asked:
        sender.run(STEP_S)
    sender.rates_hz[message_id] = ASKED_HZ[message_id]
    sender.run(20.0)
    asked, again = sender.logged
    assert again.text.endswith(" again")
    assert counted_s <= again.at_s - asked.at_s <= counted_s + 1.0
    assert len(sender.asked) == 1


def test_one_that_is_switched_off_for_good_is_asked_ever_more_rarely_and_named_once(sender: Sender) -> None:
    sender.rates_hz[ATTITUDE] = 0.0
    sender.run(400.0)
    times = [at_s for at_s, *_ in sender.asked]
    gaps = [later - earlier for earlier, later in pairwise(times)]
    assert len(gaps) == 10
    assert gaps == pytest.approx([2.5, 5.0, 10.0, 20.0, 40.0, *[60.0] * 5], abs=0.6)
    assert len(sender.logged) == 1


def test_one_that_has_sent_again_is_asked_as_soon_as_at_first(sender: Sender) -> None:
    sender.rates_hz[ATTITUDE] = 0.0
    sender.run(25.0)
    sender.rates_hz[ATTITUDE] = 10.0
    sender.run(60.0)
    before, sender.rates_hz[ATTITUDE] = len(sender.asked), 0.0
    sender.run(10.0)
    first, second = (at_s for at_s, *_ in sender.asked[before:][:2])
    assert second - first == pytest.approx(ASK_AGAIN_S, abs=0.6)


def test_a_refusal_is_reported_once(sender: Sender) -> None:
    sender.rates_hz[ATTITUDE], sender.answer = 0.0, m.MAV_RESULT_DENIED
    sender.run(30.0)
    assert sender.logged.of("streams")[1:] == ["refuses to send ATTITUDE as often as asked for"]
    sender.rates_hz[ATTITUDE] = 10.0
    sender.run(5.0)
    assert sender.logged.of("streams")[2:] == ["sends ATTITUDE again"]


@pytest.mark.parametrize("silence_s", [1.0, 2.0, 10.0])
def test_after_a_time_in_which_nothing_at_all_arrived_no_message_is_missing(sender: Sender, silence_s: float) -> None:
    """A vehicle that hangs sends nothing, and no sequence number shows it."""
    sender.run(silence_s / 2, silent=True)
    if silence_s > STALE_AFTER_S:
        sender.vehicle.connection.state = LinkState.STALE
    sender.run(silence_s / 2, silent=True)
    sender.vehicle.connection.state = LinkState.CONNECTED
    sender.run(10.0)
    assert sender.asked == []


@pytest.mark.parametrize("state", [LinkState.STALE, LinkState.LOST, LinkState.SEARCHING])
def test_one_that_is_not_heard_is_asked_for_nothing(sender: Sender, state: LinkState) -> None:
    sender.rates_hz[ATTITUDE] = 0.0
    sender.vehicle.connection.state = state
    sender.run(10.0)
    assert sender.asked == []


def test_heartbeats_are_asked_for_as_soon_as_the_link_counts_as_without(sender: Sender) -> None:
    sender.rates_hz[HEARTBEAT] = 0.0
    sender.run(3.5)
    sender.vehicle.connection.state = LinkState.MUTE
    sender.run(0.5)
    assert [message_id for _, message_id, _ in sender.asked] == [HEARTBEAT]


def test_before_it_has_acknowledged_what_to_send_nothing_is_missing() -> None:
    sends = Sender()
    sends.vehicle.start_up.asked_for_telemetry = False
    sends.rates_hz[ATTITUDE] = 0.0
    sends.run(20.0)
    assert sends.asked == []
    sends.vehicle.start_up.asked_for_telemetry = True
    sends.run(1.5)
    assert sends.asked == [], "what was counted before doesn't count"
    sends.run(2.0)
    assert sends.asked
