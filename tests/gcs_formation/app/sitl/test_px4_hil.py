"""PX4's HIL interface, against pymavlink at the other end."""

from __future__ import annotations

import math
import socket
from collections.abc import Iterator
from contextlib import closing
from typing import Any

import numpy as np
import pytest
from pymavlink.dialects.v20 import ardupilotmega

from airlink.endpoint import LOOPBACK
from gcs_formation.app.sitl import px4_hil
from gcs_formation.app.sitl.exchange import ExchangeError, Sample
from gcs_formation.app.sitl.px4_hil import GPS_EVERY, RANGE_EVERY, HilExchange
from gcs_formation.app.sitl.simulator import Home, SimulatorError
from tests.processes import LIMIT_S, free_port

STEP_S = 0.0025
HOME = Home(47.4, 8.5, 500.0, 0.0)
NORTH_G, DOWN_G = 0.22, 0.43
"""The magnetic field there, Gauss, by the World Magnetic Model to two digits."""


class Autopilot:
    """What a PX4 does with the exchange, by pymavlink."""

    def __init__(self, port: int) -> None:
        self.socket = socket.create_connection((LOOPBACK, port), LIMIT_S)
        self.mav = ardupilotmega.MAVLink(None, srcSystem=1, srcComponent=1)
        self.messages = list[Any]()

    def read(self, name: str) -> Any:
        while not any(each.get_type() == name for each in self.messages):
            self.messages += self.mav.parse_buffer(self.socket.recv(4096)) or []
        return next(each for each in reversed(self.messages) if each.get_type() == name)

    def read_to(self, time_s: float) -> None:
        while not any(each.get_type() == "HIL_SENSOR" and each.time_usec >= 1e6 * time_s for each in self.messages):
            self.messages += self.mav.parse_buffer(self.socket.recv(4096)) or []

    def act(self, time_us: int, *controls: float) -> None:
        message = self.mav.hil_actuator_controls_encode(time_us, [*controls, *[0.0] * (16 - len(controls))], 129, 1)
        self.socket.sendall(message.pack(self.mav))


@pytest.fixture
def exchange(monkeypatch: pytest.MonkeyPatch) -> Iterator[HilExchange]:
    monkeypatch.setattr(px4_hil, "FIRST_PORT", free_port() - 3)
    with closing(HilExchange(3, HOME, hovers=False, random=np.random.default_rng(1))) as found:
        yield found


@pytest.fixture
def autopilot(exchange: HilExchange) -> Iterator[Autopilot]:
    found = Autopilot(exchange.port)
    with closing(found.socket):
        yield found


def sample(number: int, **changed: Any) -> Sample:
    level = Sample(number, (0.0, 0.0, -9.8), (0.0, 0.0, 0.0), (0.0, 0.0, 0.0), (1.0, 0.0, 0.0, 0.0), (0.0,) * 3, 0.0)
    return level._replace(**changed)


def test_a_sample_is_hil_sensor_at_its_time(exchange: HilExchange, autopilot: Autopilot) -> None:
    exchange.outputs_us()
    turned = (math.sqrt(0.5), 0.0, 0.0, math.sqrt(0.5))
    for number in range(1, 2 * 4 + 1):
        exchange.answer(
            sample(number, accel_mps2=(1.0, 2.0, -9.5), gyro_rps=(0.1, -0.2, 0.3), attitude=turned, airspeed_mps=20.0)
        )
    while (seen := autopilot.read("HIL_SENSOR")).time_usec < 8 * STEP_S * 1e6:
        autopilot.messages.clear()
    assert (seen.xacc, seen.yacc, seen.zacc) == (1.0, 2.0, -9.5)
    assert (seen.xgyro, seen.ygyro, seen.zgyro) == pytest.approx((0.1, -0.2, 0.3))
    assert (seen.xmag, -seen.ymag, seen.zmag) == pytest.approx((0.01, NORTH_G, DOWN_G), abs=0.02)
    assert seen.abs_pressure == pytest.approx(954.6, abs=0.2)  # of the standard atmosphere, at 500 m
    assert seen.diff_pressure == pytest.approx(0.5 * 1.1673 * 400 / 100, abs=0.05)
    assert seen.temperature == pytest.approx(15.0 - 3.25, abs=1e-3)
    assert seen.fields_updated == 0x1FFF  # all of them
    assert seen.id == 0


def test_receivers_report_at_10_hz_where_it_is(exchange: HilExchange, autopilot: Autopilot) -> None:
    exchange.outputs_us()
    for number in range(1, 2 * GPS_EVERY + 1):
        exchange.answer(sample(number, position_m=(1111.0, -500.0, -100.0), velocity_mps=(10.0, 10.0, -2.0)))
    seen = autopilot.read("HIL_GPS")
    assert pytest.approx(0.1) == 2 * GPS_EVERY * STEP_S
    assert seen.lat / 1e7 == pytest.approx(47.4 + 1111.0 / 111_180, abs=1e-5)
    assert seen.lon / 1e7 == pytest.approx(8.5 - 500.0 / 75_500, abs=1e-5)
    assert seen.alt / 1e3 == pytest.approx(600.0, abs=1.0)
    assert (seen.vn, seen.ve, seen.vd) == pytest.approx((1000, 1000, -200), abs=30)
    assert seen.cog == pytest.approx(4500, abs=100)
    assert (seen.fix_type, seen.satellites_visible) == (3, 10)


def test_the_rangefinder_measures_along_the_bodys_axis_as_far_as_it_reaches(
    exchange: HilExchange, autopilot: Autopilot
) -> None:
    exchange.outputs_us()
    pitched = (math.cos(math.radians(30.0)), 0.0, math.sin(math.radians(30.0)), 0.0)  # by 60 degrees
    for number in range(1, 2 * RANGE_EVERY + 1):
        exchange.answer(sample(number, position_m=(0.0, 0.0, -20.0), attitude=pitched))
    seen = autopilot.read("DISTANCE_SENSOR")
    assert seen.current_distance == pytest.approx(4000, abs=10)
    assert (seen.min_distance, seen.max_distance) == (20, 10_000)
    assert seen.orientation == ardupilotmega.MAV_SENSOR_ROTATION_PITCH_270
    assert seen.time_boot_ms == 50
    for number in range(2 * RANGE_EVERY + 1, 4 * RANGE_EVERY + 1):
        exchange.answer(sample(number, position_m=(0.0, 0.0, -150.0)))
    autopilot.read_to(4 * RANGE_EVERY * STEP_S)
    assert [each.time_boot_ms for each in autopilot.messages if each.get_type() == "DISTANCE_SENSOR"][
        -1
    ] == 50  # none since


def test_outputs_for_its_newest_time_are_waited_for(exchange: HilExchange, autopilot: Autopilot) -> None:
    assert exchange.outputs_us() == px4_hil.NEUTRAL
    exchange.answer(sample(2))
    autopilot.act(5000, 0.5, -0.25, 1.0, 0.1)
    assert exchange.outputs_us() == (1750, 1375, 2000, 1550)
    exchange.answer(sample(4))
    autopilot.act(5000, 1.0, 1.0, 1.0, 1.0)  # of the time before
    autopilot.act(10_000, 0.0, 0.0, math.nan, 0.0)
    assert exchange.outputs_us() == px4_hil.NEUTRAL


def test_outputs_that_no_motor_has_are_bounded() -> None:
    assert px4_hil._pulses([math.inf, -math.inf, 7.0, -7.0], hovers=False) == (2000, 1000, 2000, 1000)


def test_a_multirotors_motors_idle_above_their_least_pulse() -> None:
    assert px4_hil._pulses([0.0, 0.5, 1.0, math.nan], hovers=True) == (1000, 1550, 1950, 1000)


def test_one_that_has_ended_is_not_waited_for(exchange: HilExchange, autopilot: Autopilot) -> None:
    exchange.outputs_us()
    exchange.answer(sample(2))
    autopilot.act(5000, 0.0, 0.0, 0.0, 0.0)
    exchange.outputs_us()
    exchange.answer(sample(4))
    autopilot.socket.close()
    with pytest.raises(ExchangeError, match="has closed its connection"):
        exchange.outputs_us()


def test_a_port_that_is_taken_is_named(exchange: HilExchange) -> None:
    with pytest.raises(SimulatorError, match=f"found TCP port {exchange.port} taken"):
        HilExchange(3, HOME, hovers=False, random=np.random.default_rng(1))
