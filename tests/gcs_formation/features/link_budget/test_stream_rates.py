"""Which messages a vehicle is asked to send less often: those that come more often than wanted."""

from __future__ import annotations

import itertools
import math

from airlink import mavlink as m
from airlink.clock import Instant, after
from airlink.endpoint import VehicleId
from airlink.frame import Frame
from airlink.messages.command import CommandLong
from airlink.messages.telemetry import Wind
from flight_model.earth import GeodeticOrigin
from gcs_formation.budget.levels import UNREAD_HZ
from gcs_formation.features.link_budget.stream_rates import StreamRates
from gcs_formation.link.link_health import Connection
from gcs_formation.vehicle.families.arduplane.arduplane import ArduPlane
from gcs_formation.vehicle.vehicle import Vehicle

RAW_IMU = 27
WIND = m.MAVLINK_MSG_ID_WIND
ORIGIN = GeodeticOrigin(math.radians(35.0), math.radians(125.0), 0.0)


class Streamed:
    """A vehicle whose messages come at some rates."""

    def __init__(self) -> None:
        self.vehicle = Vehicle(VehicleId(1, 2), 0, ArduPlane(2, ORIGIN, 0.25), Connection(0), 10.0)
        self.vehicle.connection.record_frame(Instant(0), heartbeat=True)
        self.streams, self.second, self._number = StreamRates(self.vehicle), 0, 0

    def receive(
        self, seconds: int, rates_hz: dict[int, int], unread_hz: float | None = UNREAD_HZ
    ) -> list[tuple[int, int]]:
        """Return the requests in some seconds: the message and the interval, µs."""
        asked = list[tuple[int, int]]()
        for _ in range(seconds):
            now = after(Instant(0), float(self.second))
            for message_id, rate_hz in rates_hz.items():
                for _ in range(rate_hz):
                    self._number += 1
                    message = Wind(0.0, 3.0, 0.0) if message_id == WIND else None
                    self.vehicle.receive(Frame(2, 1, self._number % 256, message_id, 2, message, b""), now)
            for each in self.streams.requests(self.vehicle.rates_hz, unread_hz, now):
                assert isinstance(each, CommandLong)
                asked.append((round(each.param1), round(each.param2)))
            self.second += 1
        return asked


def test_what_none_reads_is_asked_for_rarely_also_of_kinds_that_are_unknown_here() -> None:
    assert sorted(Streamed().receive(8, {WIND: 1, RAW_IMU: 4})) == [(RAW_IMU, 10_000_000), (WIND, 10_000_000)]


def test_what_comes_on_a_request_or_at_its_rate_is_left_alone() -> None:
    answers = {m.MAVLINK_MSG_ID_PARAM_VALUE: 10, m.MAVLINK_MSG_ID_COMMAND_ACK: 20}
    assert Streamed().receive(30, {**answers, m.MAVLINK_MSG_ID_GLOBAL_POSITION_INT: 10}) == []


def test_for_a_second_ground_station_what_we_do_not_read_stays_as_it_is() -> None:
    assert Streamed().receive(30, {WIND: 4}, None) == []


def test_a_message_that_goes_on_is_asked_again_after_each_twice_as_long() -> None:
    """Another station may ask for it every 15 s."""
    streamed = Streamed()
    asked_at = [second for second in range(200) if streamed.receive(1, {WIND: 4})]
    between = [later - earlier for earlier, later in itertools.pairwise(asked_at)]
    assert asked_at[0] <= 6
    assert between == [5, 10, 20, 40, 80]


def test_rate_0_stops_a_message() -> None:
    assert Streamed().receive(8, {WIND: 1}, 0.0) == [(WIND, -1)]
