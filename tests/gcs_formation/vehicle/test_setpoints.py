"""Which setpoints are sent: those that are news to the vehicle, and those that it may not have."""

from __future__ import annotations

import math

import pytest

from airlink import mavlink as m
from airlink.clock import Instant, after
from airlink.endpoint import VehicleId
from airlink.frame import Frame
from airlink.messages import Message
from airlink.messages.command import CommandAck, CommandInt
from flight_model.earth import GeodeticOrigin
from flight_model.flight_state import FlightState, Setpoint
from formation_scenario import load_scenario
from gcs_formation.estimation.airspeed import AirspeedScale
from gcs_formation.from_scenario import planned
from gcs_formation.link.link_health import Connection
from gcs_formation.vehicle.autopilot_family import Autopilot
from gcs_formation.vehicle.command_delivery import REPEAT_S
from gcs_formation.vehicle.families.arducopter.arducopter import ArduCopter
from gcs_formation.vehicle.families.arduplane.arduplane import ALTITUDE, HEADING, SPEED, ArduPlane
from gcs_formation.vehicle.families.px4.copter import Px4Copter
from gcs_formation.vehicle.families.px4.plane import Px4Plane
from gcs_formation.vehicle.held_setpoint import ACROSS_M, ALONG_M, HEIGHT_M_S
from gcs_formation.vehicle.vehicle import Vehicle
from gcs_formation.vehicle.velocity_setpoint import SpeedLead

ORIGIN = GeodeticOrigin(0.5, 2.0, 100.0)
START = Instant(10**10)
STEADY = Setpoint(22.0, 0.3, 200.0)
SOMEWHERE = FlightState(0.0, 0.0, 200.0, 0.0, 22.0, 0.3, 0.0, 0.0)


class Commanded:
    """A vehicle that is given a setpoint every 0.1 s and acknowledges what is sent."""

    def __init__(self, kind: type[Autopilot] = ArduPlane) -> None:
        self.vehicle = Vehicle(VehicleId(1, 2), 0, kind(2, ORIGIN, 0.25), Connection(0), 10.0)
        self.now, self._number = START, 0

    def tick(self, setpoint: Setpoint = STEADY, *, answers: bool = True, later_s: float = 0.1) -> list[int]:
        """Return the ids of the commands that are sent."""
        messages = self.vehicle.new_setpoints(setpoint, SOMEWHERE, self.now)
        sent = [each.command for each in messages if isinstance(each, CommandInt)]
        for command in sent if answers else ():
            self.acknowledge(command)
        self.now = after(self.now, later_s)
        return sent

    def acknowledge(self, command: int, result: int = m.MAV_RESULT_ACCEPTED, whom: tuple[int, int] = (255, 25)) -> None:
        answer = CommandAck(command, result, 0, 0, *whom)
        self.receive(m.MAVLINK_MSG_ID_COMMAND_ACK, answer)

    def slow_link(self, one_way_s: float) -> None:
        """Let it answer probes after this long each way."""
        for turn in range(3):
            sent = after(self.now, turn - 30.0)
            self.vehicle.clock.observe(sent, after(sent, one_way_s), after(sent, 2 * one_way_s))
        assert self.vehicle.clock.one_way_s == pytest.approx(one_way_s - 0.005)  # minus a quarter of its loop's period

    def receive(self, message_id: int, message: Message | None = None, *, lost: int = 0) -> None:
        """Receive a frame, the next one after `lost` lost ones."""
        self._number += 1 + lost
        self.vehicle.receive(Frame(2, 1, self._number % 256, message_id, 2, message, b""), self.now)


@pytest.mark.parametrize("kind", [ArduPlane, Px4Plane])
def test_an_aircraft_is_reported_what_its_sensor_reads_at_the_true_airspeed(kind):
    """At 3000 m air has 0.742 of its density at sea level (ICAO Doc 7488): 22 m/s read as 18.95."""
    commanded = Commanded(kind)
    commanded.vehicle.autopilot.airspeed_scale = AirspeedScale(3000.0, 14.0, 29.0)
    for true_mps, ias_mps in ((22.0, 22.0 * math.sqrt(0.7422)), (15.0, 14.0), (40.0, 29.0)):
        messages = commanded.vehicle.new_setpoints(Setpoint(true_mps, 0.3, 200.0), SOMEWHERE, commanded.now)
        by_speed = SPEED if kind is ArduPlane else m.MAV_CMD_DO_REPOSITION
        (commanded_mps,) = (
            each.param2 if kind is ArduPlane else each.param1
            for each in messages
            if isinstance(each, CommandInt) and each.command == by_speed
        )
        assert commanded_mps == pytest.approx(ias_mps, rel=1e-3)


def test_of_what_is_acknowledged_one_quantity_in_turn_is_repeated_after_each_second():
    commanded = Commanded()
    assert sorted(commanded.tick()) == sorted((SPEED, HEADING, ALTITUDE))
    repeated = list[int]()
    for _ in range(6):
        between = [commanded.tick() for _ in range(round(10 * REPEAT_S) - 1)]
        assert between == [[]] * len(between)
        repeated += commanded.tick()
    assert repeated == 2 * [SPEED, HEADING, ALTITUDE]


def test_where_one_quantity_is_news_all_the_time_the_others_are_repeated_after_three_seconds():
    commanded = Commanded()
    commanded.tick()
    sent = [commanded.tick(Setpoint(22.0, 0.3 + 0.1 * number, 200.0)) for number in range(1, 31)]
    assert [HEADING in each for each in sent] == [True] * 30
    assert [[each for each in tick if each != HEADING] for tick in sent] == 29 * [[]] + [[SPEED, ALTITUDE]]


def test_while_a_vehicle_gives_way_every_change_is_sent():
    commanded, little = Commanded(), 0.1 * ALONG_M
    commanded.tick()
    assert commanded.tick(Setpoint(22.0 + little, 0.3, 200.0)) == []
    commanded.vehicle.setpoints.hurries = True
    assert commanded.tick(Setpoint(22.0 + 2.0 * little, 0.3, 200.0)) == [SPEED]


@pytest.mark.parametrize(
    ("changed", "command"),
    [
        (Setpoint(22.0 + 11.0 * ALONG_M, 0.3, 200.0), SPEED),
        (Setpoint(22.0, 0.3 + 11.0 * ACROSS_M / 22.0, 200.0), HEADING),
        (Setpoint(22.0, 0.3, 200.0 - 11.0 * HEIGHT_M_S), ALTITUDE),
    ],
)
def test_a_step_by_which_the_vehicle_would_be_off_within_a_tick_is_sent_at_once(changed, command):
    """Off by 11 times a tolerance for 0.1 s is 1.1 times the tolerance; the other two have nothing new to say."""
    commanded = Commanded()
    commanded.tick()
    assert commanded.tick(changed) == [command]
    assert commanded.tick(changed) == []
    assert commanded.vehicle.setpoints.held.values == (changed.speed_mps, changed.heading_rad, changed.height_m)


def test_a_small_change_is_sent_when_it_has_lasted_for_long_enough():
    """A third of the tolerance in each tenth of a second is beyond it after four."""
    commanded = Commanded()
    commanded.tick()
    sent = [ALTITUDE in commanded.tick(Setpoint(22.0, 0.3, 200.0 + 10.0 * HEIGHT_M_S / 3.0 * 1.01)) for _ in range(6)]
    assert sent == [False, False, True, False, False, False]


def ramped(climb_mps: float, seconds: float) -> list[float]:
    """Return by how much what is held is above what is wanted at each tick, on a ramp for a time, and then level."""
    commanded, off_m = Commanded(), list[float]()
    commanded.tick()
    for tick in range(1, 600):
        height_m = 200.0 + climb_mps * min(0.1 * tick, seconds)
        commanded.tick(Setpoint(22.0, 0.3, height_m))
        off_m.append(commanded.vehicle.setpoints.held.values[2] - height_m)
    return off_m


@pytest.mark.parametrize("climb_mps", [-3.0, -1.0, 0.4, 1.0, 3.0])
def test_heights_on_a_ramp_are_held_about_what_is_wanted_and_not_behind_it(climb_mps: float) -> None:
    """Held for so long and sent as wanted, they would be behind by half of the steps on average."""
    off_m = ramped(climb_mps, 60.0)[100:]
    steps_m = max(off_m) - min(off_m)
    assert steps_m > 0.2, "they are held"
    assert abs(sum(off_m) / len(off_m)) < 0.25 * steps_m


@pytest.mark.parametrize("climb_mps", [-3.0, 1.0])
def test_where_a_ramp_ends_a_height_is_beyond_its_end_by_less_than_a_step_and_not_for_long(climb_mps: float) -> None:
    off_m = ramped(climb_mps, 20.0)
    beyond_m = [math.copysign(1.0, climb_mps) * each for each in off_m[200:]]
    assert max(beyond_m) < math.sqrt(2.0 * HEIGHT_M_S * abs(climb_mps))
    assert max(beyond_m[15:]) < 0.1


def test_a_step_of_height_is_commanded_as_it_is() -> None:
    commanded = Commanded()
    for _ in range(3):
        commanded.tick()
    assert commanded.tick(Setpoint(22.0, 0.3, 203.0)) == [ALTITUDE]
    assert commanded.vehicle.setpoints.held.values[2] == 203.0


@pytest.mark.parametrize(("autopilot", "after_ticks"), [("emulator", 6), ("arduplane", 2)])
def test_heights_of_an_aircraft_under_total_energy_control_are_news_sooner(autopilot: str, after_ticks: int) -> None:
    """Off by 0.36 m it is off by 0.21 m s after 0.6 s, and by 0.05 m s after 0.2 s."""
    path = {"speed_mps": 22, "waypoints_m": [[0, 0, 100], [900, 0, 100]]}
    scenario = load_scenario({"vehicles": {"count": 2, "autopilot": autopilot}, "path": path})
    commanded = Commanded()
    commanded.vehicle = planned(scenario)[2][VehicleId(1, 2)]
    commanded.tick()
    sent = [ALTITUDE in commanded.tick(Setpoint(22.0, 0.3, 200.36)) for _ in range(after_ticks)]
    assert sent == [False] * (after_ticks - 1) + [True]


def test_what_is_rounded_to_and_fro_is_not_sent():
    commanded = Commanded()
    commanded.tick()
    to_and_fro = [Setpoint(22.0 + off, 0.3 + off / 100.0, 200.0 + off) for off in (0.02, -0.02) * 4]
    assert [commanded.tick(each) for each in to_and_fro] == [[]] * 8
    assert commanded.vehicle.setpoints.held.values == (22.0, 0.3, 200.0)


@pytest.mark.parametrize("refuses", [False, True])
def test_what_is_not_acknowledged_is_repeated_after_each_twice_the_time(refuses):
    """Overdue after 0.15 s, the link counts as lossy: again after 0.1, 0.2, 0.4 and 0.8 s, and each second at last.

    Each wait is over at the first tick after it. What was refused twice isn't sent again alike.
    """
    commanded, sent = Commanded(), list[int]()
    for _ in range(33):
        commands = commanded.tick(answers=False)
        sent.append(len(commands))
        for command in commands if refuses else ():
            commanded.acknowledge(command, m.MAV_RESULT_FAILED)
    assert [tick for tick, count in enumerate(sent) if count] == ([0, 2] if refuses else [0, 2, 4, 7, 12, 21, 31])
    assert set(sent) == {0, 3}


def test_over_a_link_that_loses_a_repetition_follows_each_step_until_it_is_acknowledged():
    commanded = Commanded()
    commanded.tick()
    for lost in (0, 0, 1):
        commanded.receive(m.MAVLINK_MSG_ID_VFR_HUD, lost=lost)
    step = Setpoint(25.0, 0.3, 200.0)
    sent, all_three = [commanded.tick(step, answers=tick == 3) for tick in range(7)], [SPEED, ALTITUDE, HEADING]
    assert sent[0] == all_three  # the others go with the one that is news, and are repeated after twice the time
    assert [SPEED in each for each in sent] == [True, True, False, True, False, False, False]


def test_over_a_slow_link_an_answer_is_waited_for_as_long_as_it_takes():
    """Over 150 ms each way answers come after three ticks."""
    commanded, sent = Commanded(), list[int]()
    commanded.slow_link(0.15)
    pending: list[list[int]] = [[], [], []]
    for _ in range(9):
        for command in pending.pop(0):
            commanded.acknowledge(command)
        pending.append(commanded.tick(answers=False))
        sent.append(len(pending[-1]))
    assert sum(sent[3:]) == 0


def test_an_acknowledgement_that_is_too_early_answers_an_earlier_setpoint():
    """Over a link of 150 ms each way an answer within 0.1 s belongs to another setpoint."""
    commanded = Commanded()
    commanded.slow_link(0.15)
    commanded.tick(answers=False)
    commanded.acknowledge(SPEED)
    commanded.tick(answers=False, later_s=0.5)
    assert SPEED in commanded.tick(answers=False)


def test_a_vehicle_that_may_have_other_setpoints_meanwhile_is_sent_all():
    commanded = Commanded()
    commanded.tick()
    commanded.vehicle.forget_setpoints()
    assert len(commanded.tick()) == 3


def test_a_family_whose_one_command_carries_all_is_sent_it_for_any_of_them():
    commanded = Commanded(Px4Plane)
    assert [len(commanded.tick()) for _ in range(3)] == [1, 0, 0]
    assert len(commanded.tick(Setpoint(22.0, 0.4, 200.0))) == 1


@pytest.mark.parametrize(("kind", "every"), [(ArduCopter, 6), (Px4Copter, 2)])
def test_a_stream_is_repeated_five_times_within_the_failsafes_time(kind, every):
    """GUID_TIMEOUT is 3 s, COM_OF_LOSS_T 1 s."""
    copter = Vehicle(VehicleId(1, 2), 0, kind(2, ORIGIN, 0.25), Connection(0), 10.0)
    sent = [len(copter.new_setpoints(STEADY, SOMEWHERE, after(START, 0.1 * tick))) for tick in range(13)]
    assert [tick for tick, count in enumerate(sent) if count] == list(range(0, 13, every))
    assert copter.new_setpoints(Setpoint(21.0, 0.3, 200.0), SOMEWHERE, after(START, 1.3))


def test_what_a_stream_need_not_repeat_is_held_as_if_it_were_sent():
    """Climbing at one rate, a multirotor is 1.5 s behind its height setpoint, which rises all the time."""
    copter = Vehicle(VehicleId(1, 2), 0, ArduCopter(2, ORIGIN, 0.25), Connection(0), 10.0)
    for tick in range(4):
        where = FlightState(0.0, 0.0, 200.0 + 0.1 * tick, 1.0, 22.0, 0.3, 0.0, 0.0)
        sent = copter.new_setpoints(Setpoint(22.0, 0.3, where.height_m + 1.5), where, after(START, 0.1 * tick))
        assert bool(sent) == (tick == 0)
        assert copter.setpoints.held.values[2] == where.height_m + 1.5


def test_the_lead_of_an_airspeed_goes_on_while_a_command_is_held():
    """Commanded 2 m/s more at a prompt share of a half, PX4 is first commanded 4 m/s more, and then less and less."""
    lead = SpeedLead(0.5, 10.0, (10.0, 40.0), 0.1)
    plane = Px4Plane(2, ORIGIN, 0.25, None, lead)
    commanded = Commanded()
    commanded.vehicle = Vehicle(VehicleId(1, 2), 0, plane, Connection(0), 10.0)
    assert lead.lead(22.0, 22.0) == 22.0
    sent = [commanded.tick(Setpoint(24.0, 0.3, 200.0)) for _ in range(100)]
    assert 10 < len([each for each in sent if each]) < 60
    assert lead.led(24.0, 22.0) == pytest.approx(22.0 + 2.0 * (1.0 + math.exp(-10.0 / 5.0) * 0.5 * 2.0), abs=0.4)


@pytest.mark.parametrize("whom", [(255, 190), (254, 25), (255, 1)])
def test_refusals_of_another_ground_stations_commands_are_not_ours(whom: tuple[int, int]):
    """QGroundControl (255/190) behind the same router sends commands with our ids of commands, and is refused."""
    commanded = Commanded()
    for _ in range(50):
        for command in commanded.tick():
            commanded.acknowledge(command)
        commanded.acknowledge(m.MAV_CMD_GUIDED_CHANGE_SPEED, m.MAV_RESULT_DENIED, whom)
    assert not any(channel.is_refused(99, commanded.now) for channel in commanded.vehicle.setpoint_channels)
    assert all(channel.accepted for channel in commanded.vehicle.setpoint_channels)
