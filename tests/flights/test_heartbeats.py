"""Heartbeats stop when setpoints stop, so that an autopilot's own failsafe acts."""

from __future__ import annotations

import pytest

from airlink import mavlink as m
from airlink.clock import NANOSECONDS
from airlink.messages.command import ParamSet
from gcs_formation.core.cycle import EACH_SECOND, Cycle, Stage
from gcs_formation.fleet.unguided import UNGUIDED_S
from gcs_formation.recorder import Tick
from sim_vehicles.autopilot.modes_and_failsafe import Mode
from tests.flights.in_memory import World

FAILSAFE_S = 5.0
"""FS_LONG_TIMEOUT."""
HEARTBEAT_S = 1.0


def failsafe_world() -> World:
    """Three vehicles that go home when heartbeats stop: FS_GCS_ENABL 1, FS_LONG_ACTN 1."""
    world = World(duration_s=30)
    for number in (1, 2, 3):
        for name in ("FS_GCS_ENABL", "FS_LONG_ACTN"):
            asked = ParamSet(number, m.MAV_COMP_ID_AUTOPILOT1, name, 1, m.MAV_PARAM_TYPE_INT8)
            assert world.vehicle(number).parameters.set(asked)
    world.fly_to(2.0)
    return world


@pytest.mark.parametrize(("stopped_s", "goes_home"), [(3.5, False), (6.5, True)])
def test_a_control_loop_that_stands_still_sends_no_heartbeat_and_the_vehicles_go_home(
    stopped_s: float, goes_home: bool
) -> None:
    world = failsafe_world()
    world.process.stop(world.clock.now(), stopped_s)
    world.run(stopped_s)
    modes = {world.vehicle(number).pilot.mode for number in (1, 2, 3)}
    assert modes == {Mode.RTL if goes_home else Mode.GUIDED}


def test_a_vehicle_for_which_the_law_has_no_setpoint_gets_no_heartbeat_and_goes_home_alone(
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    world = failsafe_world()
    controller, begun_s = world.station.controller, world.now_s
    conclude = controller.conclude

    def without_the_last(tick: Tick) -> None:
        conclude(tick)
        tick.setpoints[2] = (*tick.setpoints[2][:2], float("nan"))

    monkeypatch.setattr(controller, "conclude", without_the_last)
    world.run(UNGUIDED_S + FAILSAFE_S + 2 * HEARTBEAT_S)
    (home_s,) = world.times_s("mode", 3, "RTL")
    (commanded_s,) = world.times_s("heartbeats", 3, "withheld")
    assert commanded_s - begun_s < UNGUIDED_S + HEARTBEAT_S + 0.2
    assert home_s - commanded_s < FAILSAFE_S + 0.2
    assert world.words("member")[-1] == "parted by its failsafe: 'GCS Failsafe On: RTL'"
    assert world.words("heartbeats") == ["withheld: there is no setpoint for it", "sent again"]
    assert [world.vehicle(number).pilot.mode for number in (1, 2)] == [Mode.GUIDED] * 2


class Seconds(Stage):
    """A stage that keeps when the stages of once a second run, s."""

    name = "seconds"
    when = EACH_SECOND

    def __init__(self) -> None:
        self.times_s = list[float]()

    def run(self, cycle: Cycle) -> None:
        self.times_s.append(cycle.now / NANOSECONDS)


@pytest.mark.parametrize("rate_hz", [1.5, 3.0, 9.0])
def test_what_is_done_once_a_second_is_so_where_ticks_do_not_divide_a_second(rate_hz: float) -> None:
    world, seconds = World(law={"rate_hz": rate_hz}), Seconds()
    world.station.cycle.order([*world.station.cycle.stages, seconds])
    world.run(5.2)  # before the path, at whose beginning the mission time is sent at once
    assert seconds.times_s == pytest.approx([0.0, 1.0, 2.0, 3.0, 4.0, 5.0], abs=0.5 / rate_hz + 1e-6)
