"""Who flies in the formation: decisions from what is known of each vehicle; vehicles are nothing more here."""

from __future__ import annotations

import math

import pytest

from airlink import mavlink as m
from airlink.clock import Instant, after
from airlink.endpoint import VehicleId
from airlink.messages.command import CommandAck
from airlink.messages.system import Timesync
from airlink.messages.telemetry import GlobalPositionInt
from gcs_formation.estimation.projection import FORGOTTEN_AFTER_S
from gcs_formation.fleet.membership import BACK_S, MUTE_S
from gcs_formation.link.link_health import LinkState
from gcs_formation.vehicle.families.arduplane.arduplane import ArduPlane
from gcs_formation.vehicle.families.px4.copter import Px4Copter
from gcs_formation.vehicle.member import Member
from tests.gcs_formation.fleet.pair import (
    FOLLOWER,
    GUIDED,
    LEADER,
    LOITER,
    MANUAL,
    ORIGIN,
    SET_MODE,
    Formation,
)


def test_vehicles_that_are_heard_and_guided_fly_in_the_formation_and_are_commanded_nothing() -> None:
    formation = Formation()
    assert [each.member for each in formation.vehicles.values()] == [Member.FLYING] * 2
    assert formation.logged.of("member") == ["flying in formation"] * 2
    formation.judge(1.0)
    assert len(formation.logged) == 2, "said when it changes"
    assert formation.told() == []


def words(formation: Formation, at_s: float, text: str) -> None:
    formation.membership.receive(formation.follower, text, after(Instant(0), at_s))


@pytest.mark.parametrize("said_s", [0.5, 2.5])
def test_one_whose_failsafe_speaks_before_its_mode_shows_or_after_that_has_not_its_pilot_to_thank(
    said_s: float,
) -> None:
    formation, text = Formation(), "Failsafe. Long event on: type=3/reason=5"
    if said_s < 1.0:
        words(formation, said_s, text)
    formation.reports(m.PLANE_MODE_RTL)
    assert formation.judge(1.0) is Member.PARTED
    if said_s > 1.0:
        words(formation, said_s, text)
    words(formation, 3.0, text)
    pilots = [] if said_s < 1.0 else ["parted by its pilot"]
    assert formation.logged.of("member", 2)[1:] == [*pilots, f"parted by its failsafe: '{text}'"]


@pytest.mark.parametrize("said", [(0.0, "Failsafe"), (4.5, "Failsafe"), (1.0, "Failsafe. Long event off: reason=3")])
def test_what_a_failsafe_says_long_before_or_after_or_at_its_end_is_not_its_reason(said: tuple[float, str]) -> None:
    formation = Formation()
    if said[0] < 4.0:
        words(formation, *said)
    formation.reports(m.PLANE_MODE_RTL)
    formation.judge(1.4 if said[0] else 3.1)
    if said[0] > 4.0:
        words(formation, *said)
    assert formation.logged.of("member", 2)[1:] == ["parted by its pilot"]


def test_one_that_was_left_alone_may_have_been_parted_by_its_failsafe() -> None:
    """It needn't say so: heartbeats were withheld, or nothing that was sent can have reached it."""
    formation = Formation()
    formation.follower.left_alone(after(Instant(0), 0.5))
    formation.reports(m.PLANE_MODE_RTL)
    formation.judge(1.0)
    formation.reports(GUIDED)
    formation.judge(10.0)
    formation.silent(16.0)
    formation.reports(m.PLANE_MODE_RTL)
    formation.judge(17.0)
    told = ["parted by its pilot or its failsafe, in RTL", "flying in formation"]
    assert formation.logged.of("member", 2)[1:] == [*told, Member.NO_LINK.value, told[0]]


def test_what_its_failsafe_says_is_known_of_each_family() -> None:
    copter = Px4Copter(2, ORIGIN, 0.25)
    assert copter.tells_failsafe("Offboard control signal lost")
    assert copter.tells_failsafe("Failsafe activated")
    assert not copter.tells_failsafe("Offboard control signal regained")
    assert not ArduPlane(1, ORIGIN, 0.25).tells_failsafe("Airspeed sensor lost")


def test_a_silent_follower_is_commanded_nothing_at_first_and_to_loiter_once_the_others_no_longer_keep_clear() -> None:
    formation = Formation()
    assert formation.silent(formation.max_age_s - 0.1) is Member.FLYING
    assert formation.silent(formation.max_age_s + 0.1) is Member.NO_LINK
    assert formation.silent(FORGOTTEN_AFTER_S - 0.1) is Member.NO_LINK
    assert formation.told() == []
    assert formation.silent(FORGOTTEN_AFTER_S + 0.1) is Member.HOLDING
    assert formation.told() == [LOITER]
    assert formation.vehicles[LEADER].member is Member.FLYING


def test_one_that_is_heard_again_has_a_moment_to_answer_before_it_is_commanded_to_loiter() -> None:
    """It hung for 8 s; its first frame comes before its first answer."""
    formation = Formation()
    for at_s in (5.0, 6.0, 8.0):
        assert formation.silent(at_s) is (Member.NO_LINK if at_s > formation.max_age_s else Member.FLYING)
    for at_s in (8.1, 9.5, 9.7):
        formation.follower.connection.record_frame(after(Instant(0), at_s), heartbeat=True)
        assert formation.judge(at_s, received=False) is (Member.HOLDING if at_s > 8.1 + 1.5 else Member.NO_LINK)
    back = Formation()
    back.silent(8.0)
    back.ages_s[1] = 0.0
    assert back.judge(8.3) is Member.FLYING
    assert back.told() == []


@pytest.mark.parametrize("returns", [False, True])
def test_one_that_refuses_to_loiter_or_to_come_back_is_commanded_again(returns: bool) -> None:
    formation = Formation()
    formation.silent(FORGOTTEN_AFTER_S + 0.1)
    if returns:
        formation.reports(LOITER)
        formation.ages_s[1] = 0.0
        assert formation.judge(41.0) is Member.RETURNING
    commands, now = formation.follower.commands, after(Instant(0), 50.0)
    first = commands.due(now)
    commands.acknowledge(CommandAck(m.MAV_CMD_DO_SET_MODE, m.MAV_RESULT_DENIED), now)
    again = commands.due(after(now, 5.0))
    assert first is not None
    assert again is not None
    assert (again.command, again.param2) == (first.command, first.param2) == (176, GUIDED if returns else LOITER)


def test_one_that_is_heard_and_answers_nothing_is_commanded_to_loiter_at_once_when_its_time_is_over() -> None:
    """It sends, so the others see where it goes; and it may hear."""
    formation = Formation()
    for at_s in (1.0, formation.max_age_s - 0.1, formation.max_age_s + 0.1):
        formation.follower.connection.record_frame(after(Instant(0), at_s), heartbeat=True)
        member = formation.judge(at_s, received=False)
    assert member is Member.HOLDING
    assert formation.told() == [LOITER]


def test_one_whose_heartbeats_are_missing_flies_on_for_a_while_and_is_commanded_to_loiter_then() -> None:
    """Its telemetry arrives, but its mode isn't known any more."""
    formation, begun = Formation(), Instant(0)
    found: dict[float, Member] = {}
    for tenth in range(1, 80):
        now = after(begun, 0.1 * tenth)
        formation.follower.connection.record_frame(now, heartbeat=False)
        formation.follower.round_trips._answered = now
        formation.follower.connection.check(now)
        found[0.1 * tenth] = formation.judge(0.1 * tenth, received=False)
    assert formation.follower.connection.state is LinkState.MUTE
    (reported_s,) = [each.at_s for each in formation.logged if each.text == "told to loiter" and each.vehicle == 2]
    assert reported_s == pytest.approx(3.5 + MUTE_S, abs=0.15)


@pytest.mark.parametrize(("leaders_last_s", "together"), [(0.8, True), (1.2, True), (3.0, False)])
def test_all_whose_heartbeats_are_overdue_leave_with_the_first_as_circles_begun_a_second_apart_cross(
    leaders_last_s: float, together: bool
) -> None:
    formation = Formation()
    for tenth in range(1, 90):
        now = after(Instant(0), 0.1 * tenth)
        for each in formation.vehicles.values():
            leads = each is not formation.follower
            each.connection.record_frame(now, heartbeat=leads and 0.1 * tenth <= leaders_last_s)
            each.round_trips._answered = now
            each.connection.check(now)
        formation.judge(0.1 * tenth, received=False)
    left_s = {each.vehicle: each.at_s for each in formation.logged if each.text == "told to loiter"}
    assert left_s[2] == pytest.approx(3.5 + MUTE_S, abs=0.15)
    assert left_s[1] == pytest.approx(left_s[2] if together else leaders_last_s + 3.5 + MUTE_S, abs=0.15)


@pytest.mark.parametrize("loses", [True, False])
def test_over_a_link_that_loses_the_command_to_loiter_is_sent_twice(*, loses: bool) -> None:
    """One that is late for a loss would circle across the others' circles."""
    formation, follower = Formation(), VehicleId(1, 2)
    vehicle = formation.vehicles[follower]
    vehicle.setpoints.lost_at = Instant(0) if loses else after(Instant(0), -60.0)
    vehicle.unfit = "its position doesn't move by its velocity"
    assert formation.judge(1.0) is Member.HOLDING
    sent = [vehicle.commands.due(after(Instant(0), at_s)) is not None for at_s in (1.0, 1.1, 1.2)]
    assert sent == [True, loses, False]


def test_one_that_its_pilot_lets_loiter_is_the_pilot_s_also_where_it_has_no_leader_to_follow() -> None:
    """It would count as ours otherwise, and be commanded back as soon as there is a leader."""
    formation = Formation()
    formation.reports(MANUAL, LEADER)
    formation.reports(LOITER)
    assert formation.judge(1.0) is Member.PARTED
    assert formation.vehicles[LEADER].member is Member.PARTED


def test_one_whose_mode_is_not_known_does_not_come_back() -> None:
    formation = Formation()
    formation.silent(FORGOTTEN_AFTER_S + 1.0)
    formation.reports(LOITER)
    formation.ages_s[1] = 0.0
    formation.judge(40.0)
    formation.follower.member, formation.follower.connection.state = Member.HOLDING, LinkState.MUTE
    formation.follower.connection.last_received = formation.follower.round_trips._answered = after(Instant(0), 40.1)
    assert formation.judge(40.1, received=False) is Member.HOLDING


def test_a_command_to_loiter_that_may_still_arrive_is_revoked_at_once_and_until_then_others_keep_clear() -> None:
    """It counted as following setpoints while it circled: two came within 5.2 m of each other."""
    formation = Formation()
    vehicle, deaf_s = formation.follower, formation.max_age_s + 1.0
    for each in formation.vehicles.values():
        each.connection.record_frame(after(Instant(0), deaf_s), heartbeat=True)
    formation.vehicles[LEADER].round_trips._answered = after(Instant(0), deaf_s)
    assert formation.judge(deaf_s, received=False) is Member.HOLDING
    assert (formation.told(), vehicle.circles) == ([LOITER], True)
    assert formation.judge(deaf_s + 0.5) is Member.FLYING
    assert (formation.told(), vehicle.may_loiter, vehicle.circles) == ([GUIDED], True, True)
    assert vehicle.commands.due(formation.now) is not None
    vehicle.commands.acknowledge(CommandAck(SET_MODE, m.MAV_RESULT_ACCEPTED), formation.now)
    assert (vehicle.may_loiter, vehicle.circles) == (False, False)


def test_a_command_to_loiter_that_is_shown_to_have_been_revoked_is_not_revoked_again() -> None:
    formation = Formation()
    formation.follower.member = Member.RETURNING
    assert formation.judge(1.0) is Member.FLYING
    assert formation.told() == []


def test_one_whose_positions_cannot_be_used_is_commanded_to_loiter_with_the_reason() -> None:
    formation = Formation()
    follower, asked_at = formation.follower, after(Instant(0), 5.9)
    sampler, formation.ages_s[1] = follower.sampler, formation.max_age_s + 0.1
    sampler.refused = True
    follower.round_trips.measure(Timesync(6_000_000_000, asked_at), formation.now)
    formation.follower.telemetry.store(GlobalPositionInt(1000.0, 0.6, 2.1, 100.0, 100.0, 22.0, 0.0, 0.0, 0.0))
    assert formation.judge(6.0) is Member.HOLDING
    (said,) = formation.logged.of("member", 2)[1:]
    assert said.startswith("told to loiter: its TIMESYNC tells another time than the stamps of its positions: ")


def test_one_that_comes_back_needs_fresher_telemetry_than_one_that_never_left() -> None:
    formation = Formation()
    formation.silent(FORGOTTEN_AFTER_S + 1.0)
    formation.reports(LOITER)
    formation.ages_s[1] = BACK_S + 0.1
    assert formation.judge(40.0) is Member.HOLDING
    formation.ages_s[1] = BACK_S - 0.1
    assert formation.judge(41.0) is Member.RETURNING
    assert formation.told() == [GUIDED]
    formation.reports(GUIDED)
    assert formation.judge(42.0) is Member.FLYING


def test_without_a_leader_its_followers_loiter_at_heights_of_their_own() -> None:
    formation = Formation()
    formation.reports(MANUAL, LEADER)
    assert formation.judge(1.0) is Member.HOLDING
    assert formation.vehicles[LEADER].member is Member.PARTED
    assert formation.told() == [LOITER]
    assert formation.told(LEADER) == [], "a pilot's vehicle is told nothing"
    assert abs(formation.follower.holds_at_m - 100.0) >= 15.0 - 1e-6


def test_one_that_loiters_keeps_its_height_and_the_next_gets_another_though_that_one_is_not_there_yet() -> None:
    formation = Formation()
    leader = formation.vehicles[LEADER]
    leader.member, leader.holds_at_m = Member.HOLDING, 108.0  # it is at 100 m, on its way up
    leader.unfit = formation.follower.unfit = "its stamps stand still"
    assert formation.judge(1.0) is Member.HOLDING
    assert formation.follower.holds_at_m == pytest.approx(123.0)


def test_while_the_station_connects_followers_need_no_leader_and_none_needs_telemetry_that_was_never_there() -> None:
    formation = Formation()
    formation.reports(MANUAL, LEADER)
    formation.ages_s = [math.nan, math.nan]
    leader = formation.vehicles[LEADER]
    formation.membership.update(leader, formation.estimator, formation.now, connecting=True)
    assert formation.follower.member is Member.FLYING


def test_one_that_is_to_be_held_for_its_loop_s_delay_loiters() -> None:
    formation = Formation()
    formation.beyond.add(FOLLOWER)
    assert formation.judge(1.0) is Member.HOLDING


def test_at_the_end_none_who_circles_is_commanded_to_come_back_and_each_has_the_height_of_its_circle() -> None:
    formation = Formation()
    formation.membership.end({FOLLOWER: 130.0})
    formation.silent(FORGOTTEN_AFTER_S + 1.0)
    assert formation.follower.holds_at_m == 130.0
    formation.reports(LOITER)
    formation.ages_s[1] = 0.0
    assert formation.judge(60.0) is Member.HOLDING


@pytest.mark.parametrize("member", [Member.FLYING, Member.NO_LINK, Member.HOLDING, Member.RETURNING])
def test_one_that_is_heard_in_a_mode_that_none_of_our_commands_leads_to_is_its_pilot_s_whatever_else_is_known(
    member: Member,
) -> None:
    """After an outage its first heartbeat arrives before any telemetry recent enough to fly by."""
    formation = Formation()
    formation.follower.member, formation.ages_s[1] = member, formation.max_age_s + 1.0
    formation.reports(MANUAL)
    assert formation.judge(10.0) is Member.PARTED
    assert formation.told() == []
