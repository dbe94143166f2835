"""The command that a leader flies by at an instant, from earlier setpoints and when they act."""

from __future__ import annotations

import math

import pytest

from airlink.clock import NANOSECONDS, Instant
from gcs_formation.guidance.leader_commands import LeaderCommand, LeaderCommands

TICK_S = 0.1
TURN_RPS = 0.2


def leader(ticks: int) -> LeaderCommands:
    """Command it at each tick, effective 0.4 s later, to turn right through south and to gain 0.5 m/s per second."""
    commands = LeaderCommands(TICK_S)
    for tick in range(ticks):
        at_s = TICK_S * tick
        heading_rad = math.remainder(math.pi - 0.1 + TURN_RPS * at_s, math.tau)
        turn_rps = TURN_RPS if tick else 0.0
        commands.add(instant(at_s + 0.4), LeaderCommand(22.0 + 0.5 * at_s, heading_rad, 100.0, turn_rps))
    return commands


def instant(at_s: float) -> Instant:
    return Instant(round(at_s * NANOSECONDS))


def test_a_follower_whose_setpoint_acts_sooner_gets_what_the_leader_still_flies_by():
    """The leader's setpoint of 1.9 s acts at 2.3 s; 0.32 s earlier it flies by a mean of setpoints 3.2 ticks older."""
    newest, older = (leader(20).at(instant(at_s)) for at_s in (2.3, 1.98))
    assert (newest.speed_mps, older.speed_mps) == pytest.approx((22.95, 22.79))
    turned_rad = [each.heading_rad - (math.pi - 0.1) for each in (newest, older)]
    assert turned_rad == pytest.approx([0.38, 0.316])  # through south without a jump
    assert (newest.turn_rps, older.turn_rps) == pytest.approx((TURN_RPS, TURN_RPS))


def test_outside_of_what_it_was_given_the_nearest_holds():
    oldest, newest = (leader(20).at(instant(at_s)) for at_s in (0.0, 9.0))
    assert (oldest.speed_mps, newest.speed_mps) == pytest.approx((22.0, 22.95))
    assert (oldest.turn_rps, newest.turn_rps) == pytest.approx((0.0, TURN_RPS))


def test_another_leader_has_not_turned_from_where_the_last_one_headed():
    commands = leader(20)
    commands.drop_state()
    commands.add(instant(2.4), LeaderCommand(20.0, -1.0, 100.0, 0.0))
    begun = commands.at(instant(2.0))
    assert (begun.heading_rad, begun.turn_rps) == (-1.0, 0.0)


def sent(dt_s: float, acts_s: list[float]) -> LeaderCommands:
    """Return commands that act at these times, each 10 m higher than the one before."""
    commands = LeaderCommands(dt_s)
    for count, at_s in enumerate(acts_s):
        commands.add(instant(at_s), LeaderCommand(20.0, 0.0, 10.0 * count, 0.1 * count))
    return commands


def test_between_two_ticks_all_of_a_command_is_linear():
    commands = sent(1.0, [1.0, 2.0, 3.0])
    heights_m = [commands.at(instant(at_s)).height_m for at_s in (0.5, 1.0, 1.3, 2.0, 2.9, 3.0, 3.5)]
    rates_rps = [commands.at(instant(at_s)).turn_rps for at_s in (0.5, 1.0, 1.3, 2.0, 2.9, 3.0, 3.5)]
    assert heights_m == pytest.approx([0.0, 0.0, 3.0, 10.0, 19.0, 20.0, 20.0])
    assert rates_rps == pytest.approx([each / 100.0 for each in heights_m])


def test_a_setpoint_that_acts_sooner_than_the_one_before_replaces_it():
    """The delay of the link may fall between two ticks; the later setpoint still is the one that lasts."""
    commands = sent(1.0, [1.0, 2.0, 1.8, 3.0])
    heights_m = [commands.at(instant(at_s)).height_m for at_s in (1.5, 2.0, 2.5)]
    assert heights_m == pytest.approx([5.0, 20.0, 25.0])


@pytest.mark.parametrize(("dt_s", "kept"), [(0.1, 60), (0.5, 12), (10.0, 2)])
def test_the_last_six_seconds_are_kept_and_two_ticks_at_least(dt_s: float, kept: int):
    commands = sent(dt_s, [dt_s * each for each in range(100)])
    assert commands.at(instant(0.0)).height_m == 10.0 * (100 - kept)
    assert commands.at(instant(98.5 * dt_s)).height_m == pytest.approx(985.0)
