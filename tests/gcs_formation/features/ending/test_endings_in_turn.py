"""Endings of a formation: what they tell the separation and landings, and who may circle at one height."""

from __future__ import annotations

from types import SimpleNamespace
from typing import Any
from unittest.mock import Mock

import pytest

from airlink import mavlink as m
from airlink.clock import Instant, after
from airlink.endpoint import Address, VehicleId
from formation_scenario import load_scenario
from formation_scenario.orders import End
from gcs_formation.features.ending.ending import SeparatedEnding, SeparatedEndings
from gcs_formation.features.ending.landing_order import LandingOrder
from gcs_formation.fleet.circle_heights import GroundFloor
from gcs_formation.link.link_health import Connection, LinkState
from gcs_formation.mission.ending import LOITER_LIMIT_S
from gcs_formation.recorder import VehicleLink
from gcs_formation.vehicle.member import Member
from gcs_formation.vehicle.vehicle import Vehicle
from tests.flights.conftest import scenario
from tests.flights.test_landing import LEVEL, NOW, commanded, hovering, plane, tell
from tests.gcs_formation.features.ending.test_ending import loiters_at, refuse, sent_to

GAP_M = 10.0
SECOND = {"id": 2, "role": "follower", "model": {"climb_max_mps": 1.5}}
SLOW = load_scenario(scenario(vehicles=[{"id": 1, "role": "leader"}, SECOND, {"id": 3, "role": "follower"}]))
"""A flight whose second vehicle climbs more slowly than the others."""


def ended(*vehicles: Vehicle, manner: End = "loiter", **more: Any) -> SeparatedEnding:
    """Return an ending whose vehicles are being commanded to leave."""
    end = SeparatedEnding({each.identity: each for each in vehicles}, LEVEL, manner, gap_m=GAP_M, **more)
    end.start(NOW)
    end.leave(NOW)
    return end


@pytest.mark.parametrize(
    ("up_m", "away_m", "reported"), [(9.9, 0.0, True), (10.1, 0.0, False), (0.0, 399.0, True), (0.0, 401.0, False)]
)
def test_those_that_may_circle_at_one_height_are_reported_until_both_have_acknowledged_theirs(
    up_m: float, away_m: float, reported: bool
) -> None:
    one, other = plane(1, 0.0, 0.0), plane(2, away_m, 0.0, 100.0 + up_m)
    end = ended(one, other)
    text = f"vehicles 1 and 2 may circle at heights {up_m:.1f} m apart: 1 hasn't acknowledged its height"
    assert end.at_one_height() == [text] * reported
    sent_to(one)
    assert end.at_one_height() == [text.replace(": 1", ": 2")] * reported
    sent_to(other)
    assert end.at_one_height() == []


def test_who_refuses_its_height_is_reported_with_the_command_and_the_answer() -> None:
    one, other = plane(1, 0.0, 0.0), plane(2, 0.0, 0.0)
    end = ended(one, other)
    sent_to(one)
    refuse(other, m.MAV_RESULT_DENIED)
    said = "vehicles 1 and 2 may circle at heights 0.0 m apart: 2 refuses mode LOITER (DO_SET_MODE: DENIED)"
    assert end.at_one_height() == [said]
    tell(other, 0.0, 0.0, 0.0, armed=False)
    assert end.at_one_height() == [], "it is down"


def test_vehicles_that_hover_where_they_are_need_no_heights_and_circle_nowhere() -> None:
    each = [hovering(number, 3.0, 100.0, 0.0) for number in (1, 2)]
    end = ended(*each)
    assert end.hovers
    assert list(end.circles_m.values()) == pytest.approx([100.0, 100.0], abs=0.01)
    assert end.at_one_height() == []
    assert not ended(*each, manner="rtl").hovers
    assert not ended(*each, plane(3, 0.0, 0.0)).hovers


def test_only_who_is_reported_its_way_home_is_watched() -> None:
    """One that doesn't answer for 5 s circles where it is; one that is only to circle is left to that."""
    for manner, waited_s, reported in (("rtl", 5.0, False), ("rtl", 5.1, True), ("loiter", 60.0, False)):
        vehicle = plane(1, 0.0, 0.0)
        vehicle.telemetry.custom_mode = m.PLANE_MODE_GUIDED
        end = ended(vehicle, manner=manner)  # type: ignore[arg-type]
        lists = vehicle.commands.lists
        end.advance(after(NOW, waited_s))
        assert (vehicle.commands.lists > lists) is reported
        end.advance(after(NOW, 60.0))
        assert vehicle.commands.lists == lists + (manner == "rtl"), "it is reported once"


def test_one_that_is_on_its_way_home_and_silent_is_not_called_back() -> None:
    vehicle = plane(1, 0.0, 0.0)
    end = ended(vehicle, manner="rtl")
    assert vehicle.telemetry.custom_mode == m.PLANE_MODE_RTL
    lists = vehicle.commands.lists
    end.advance(after(NOW, 60.0))
    assert vehicle.commands.lists == lists


def test_one_that_acknowledged_its_way_home_and_is_in_another_mode_later_is_not_called_back() -> None:
    """Its pilot may have chosen that mode."""
    vehicle = plane(1, 0.0, 0.0)
    end = ended(vehicle, manner="rtl")
    sent_to(vehicle)
    vehicle.telemetry.custom_mode = m.PLANE_MODE_MANUAL
    lists = vehicle.commands.lists
    end.advance(after(NOW, 60.0))
    assert vehicle.commands.lists == lists


def landing(*vehicles: Vehicle) -> SeparatedEnding:
    """Return an ending in landings whose vehicles are over their homes, at their heights."""
    end = ended(*vehicles, manner="land")
    for vehicle in vehicles:
        sent_to(vehicle)
        assert vehicle.take_off.stood is not None
        home = vehicle.take_off.stood
        tell(vehicle, home.north_m, home.east_m, end.circles_m[vehicle.identity])
    return end


def test_vehicles_that_land_circle_above_all_approaches_in_the_order_of_their_landings() -> None:
    """The rear one stands under the front one's approach. An approach is 55 m high, and circles begin at 70 m."""
    rear, front = plane(1, -70.0, 0.0, 40.0), plane(2, 0.0, 0.0, 60.0)
    assert LandingOrder({each.identity: each for each in (rear, front)}, LEVEL).first != {}
    end = ended(rear, front, manner="land")
    assert end.circles_m == pytest.approx({VehicleId(1, 2): 70.0, VehicleId(1, 1): 85.0}, abs=0.01)


def test_a_landing_goes_on_as_long_as_it_takes_and_then_the_flight_is_over() -> None:
    low, high = plane(1, 0.0, 0.0), plane(2, 0.0, 60.0)
    end = landing(low, high)
    end.advance(NOW)
    assert sent_to(low) == [(m.MAV_CMD_DO_SET_MODE, m.PLANE_MODE_AUTOLAND)]
    assert end.pending() == [low, high]
    assert not end.over(10.0 * LOITER_LIMIT_S)
    for vehicle in (low, high):
        tell(vehicle, 0.0, 60.0 * vehicle.index, 0.0, armed=False)
        end.advance(NOW)
        end.advance(NOW)
        sent_to(vehicle)
        if vehicle is low:
            sent_to(high)
    assert end.pending() == []
    assert end.over(0.1)
    assert end.failure is None


def test_one_that_climbs_out_keeps_the_others_from_landing() -> None:
    low, climbs = plane(1, 0.0, 0.0), plane(2, 0.0, 60.0, 20.0)
    climbs.telemetry.custom_mode = m.PLANE_MODE_TAKEOFF
    end = landing(low)
    ours = SeparatedEnding({each.identity: each for each in (low, climbs)}, LEVEL, "land", end.landings, gap_m=GAP_M)
    ours.leave(NOW)
    ours.advance(NOW)
    assert commanded(low) is None
    climbs.member = Member.PARTED
    ours.advance(NOW)
    assert commanded(low) == m.PLANE_MODE_AUTOLAND, "its pilot flies it"


def test_one_that_answered_late_and_circled_first_does_not_keep_the_others_from_landing() -> None:
    """It leaves its command home unanswered for more than 5 s, and then does all that it is commanded."""
    low, late = plane(1, 0.0, 0.0), plane(2, 0.0, 60.0)
    late.telemetry.custom_mode = m.PLANE_MODE_GUIDED
    end = ended(low, late, manner="land")
    answered = after(NOW, 5.1)
    end.advance(answered)
    for vehicle in (low, late):
        sent_to(vehicle, answered)
        tell(vehicle, 0.0, 60.0 * vehicle.index, end.circles_m[vehicle.identity])
    end.advance(answered)
    assert sent_to(low, answered) == [(m.MAV_CMD_DO_SET_MODE, m.PLANE_MODE_AUTOLAND)]


def test_haste_lands_no_other_and_waits_for_acknowledgements_alone() -> None:
    low, high = plane(1, 0.0, 0.0), plane(2, 0.0, 60.0)
    end = landing(low, high)
    end._loiter_s = 40.0
    end.hasten()
    assert not end.landings.under_way
    assert end.pending() == []
    assert end.over(0.0)


def test_a_landing_under_way_is_left_to_itself_when_another_end_is_ordered() -> None:
    low, high = plane(1, 0.0, 0.0), plane(2, 0.0, 60.0)
    first = landing(low, high)
    first.advance(NOW)
    sent_to(low)
    second = begun(None, [low, high], "loiter", first)
    second.leave(NOW)
    assert commanded(low) is None
    assert [each[0] for each in sent_to(high)] == [each[0] for each in loiters_at(0.0)]
    assert list(second.circles_m) == [high.identity]
    assert second.landings is first.landings
    assert begun(None, [low, high], "loiter", Mock()).landings is not first.landings


def test_one_that_is_commanded_otherwise_no_longer_waits_to_land() -> None:
    low, high = plane(1, 0.0, 0.0), plane(2, 0.0, 60.0)
    end = landing(low, high)
    high.restarts += 1
    end.advance(NOW)
    assert end.landings.is_pending(high)
    tell(high, 0.0, 60.0, 0.0, armed=False)
    high.restarts += 1
    end.advance(NOW)
    assert not end.landings.is_pending(high)


def test_as_long_as_the_formation_is_separated_it_is_commanded_by_that() -> None:
    end = SeparatedEnding({}, LEVEL)
    assert end.steer([], NOW) is None
    assert end.may_leave(NOW)
    separation = Mock()
    separation.steer.return_value, separation.over.return_value = [7.0], False
    end.open(separation)
    links, now = [VehicleLink(NOW)], Instant(5)
    assert end.steer(links, now) == [7.0]
    separation.steer.assert_called_once_with(links, now)
    assert not end.may_leave(now)
    separation.over.assert_called_once_with(now)


def cycle_of(vehicles: list[Vehicle], sway_m: float = 0.0) -> Any:
    """Return a cycle whose formation flies north at 22 m/s."""
    ahead = Mock(side_effect=lambda seconds: [(22.0 * seconds * share, 0.0) for share in (0.0, 1.0)])
    controller = SimpleNamespace(ahead_m=ahead, estimator=SimpleNamespace(sway_m=sway_m), guidance=Mock())
    controller.last_tick = SimpleNamespace(setpoints=[(22.0, 0.0, 100.0)] * len(vehicles))
    controller.plan = SimpleNamespace(leader=0)
    named = {each.identity: each for each in vehicles}
    return SimpleNamespace(scenario=SLOW, vehicles=named, controller=controller)


def begun(
    cycle: Any, vehicles: list[Vehicle], manner: End, earlier: Any = None, *, commanded: bool = False
) -> SeparatedEnding:
    endings = SeparatedEndings(cycle or cycle_of(vehicles))
    return endings.start(manner, earlier, 3.0, NOW, commanded=commanded)


@pytest.mark.parametrize("is_commanded", [True, False])
def test_a_formation_that_is_commanded_separates_along_its_path_first(is_commanded: bool) -> None:
    """The slowest climbs at 1.5 m/s: the third by 30 m, in 20 s and 15 s more."""
    each = [plane(number, 0.0, 0.0) for number in (1, 2, 3)]
    for vehicle in each:
        vehicle.connection = Connection(0, Address("127.0.0.1", 1), LinkState.CONNECTED)
    cycle = cycle_of(each)
    end = begun(cycle, each, "loiter", commanded=is_commanded)
    assert end.limit_s == pytest.approx(35.0, abs=0.1)
    assert bool(cycle.controller.ahead_m.called) is is_commanded
    links = [VehicleLink(NOW) for _ in each]
    for vehicle, link in zip(each, links, strict=True):
        vehicle.connection.last_received, link.ready = NOW, True
    assert (end.steer(links, NOW) is not None) is is_commanded
    assert end.may_leave(NOW) is not is_commanded
    assert end.may_leave(after(NOW, 34.8)) is not is_commanded
    assert end.may_leave(after(NOW, 35.1))
    cycle.controller.guidance.fly_at.assert_not_called()
    assert not end.over(2.9)


def test_multirotors_are_all_stopped_before_any_hovers() -> None:
    each = [hovering(number, 30.0 * number, 100.0, 0.9) for number in (1, 2, 3)]
    cycle = cycle_of(each)
    end = begun(cycle, each, "loiter", commanded=True)
    cycle.controller.guidance.fly_at.assert_called_once_with(0.0)
    assert end._separation is not None
    assert end._separation._stops
    cycle.controller.guidance.fly_at.reset_mock()
    begun(cycle, each, "loiter")
    begun(cycle, each, "rtl", commanded=True)
    cycle.controller.guidance.fly_at.assert_not_called()


def test_air_that_moves_vehicles_makes_levels_farther_apart() -> None:
    """Four standard deviations of the relative displacement, 4 √2 · 3 m, and the 10 m that vehicles keep apart."""
    each = [plane(number, 0.0, 0.0) for number in (1, 2)]
    cycle = cycle_of(each, sway_m=3.0)
    end = begun(cycle, each, "loiter")
    end.leave(NOW)
    kept_m = cycle.scenario.safety.kept_m
    apart_m = abs(end.circles_m[each[0].identity] - end.circles_m[each[1].identity])
    assert apart_m == pytest.approx(kept_m + 4.0 * 2.0**0.5 * 3.0, abs=0.01)


def test_an_end_in_landings_is_refused_where_they_cannot_land_and_no_other_is() -> None:
    each = [plane(1, 0.0, 0.0), plane(2, -50.0, 0.0)]
    endings = SeparatedEndings(cycle_of(each))
    said = "vehicle 1 would come in over the place of vehicle 2; allowed: rtl, loiter"
    assert endings.why_not("land") == said
    assert endings.why_not("rtl") is endings.why_not("loiter") is None
    assert SeparatedEndings(cycle_of(each[:1])).why_not("land") is None


def test_circles_at_home_are_one_above_the_other_wherever_vehicles_are() -> None:
    hill = {"shape": "cosine", "north_m": 1900, "east_m": 0, "height_m": 90, "radius_m": 100}
    planned = load_scenario(
        scenario(
            terrain={"clearance_m": 60, "hills": [hill]},
            path={"speed_mps": 22, "waypoints_m": [[0, 3000, 100], [2000, 3000, 100]]},
        )
    )
    near, far = plane(1, 0.0, 0.0), plane(2, 3000.0, 0.0)
    tell(far, 0.0, 0.0, 100.0)
    named = {each.identity: each for each in (near, far)}
    end = SeparatedEnding(named, GroundFloor(planned), "rtl", gap_m=GAP_M)
    end.leave(NOW)
    assert sorted(end.circles_m.values()) == pytest.approx([150.0, 165.0], abs=1.5), "the far one's way home is over it"
