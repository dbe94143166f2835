"""When the formation begins to be commanded: once its leader follows, or under a virtual one all that are left do."""

from __future__ import annotations

import math
from typing import Any

import pytest

from airlink.clock import Instant
from airlink.endpoint import VehicleId
from flight_model.earth import GeodeticOrigin
from formation_scenario import load_scenario
from gcs_formation.link.link_health import Connection, LinkState
from gcs_formation.mission.beginning import Beginning
from gcs_formation.vehicle.families.arduplane.arduplane import ArduPlane
from gcs_formation.vehicle.member import Member
from gcs_formation.vehicle.startup import StartUp
from gcs_formation.vehicle.vehicle import Vehicle
from tests.flights.conftest import scenario

ORIGIN = GeodeticOrigin(math.radians(35.0), math.radians(125.0), 0.0)
NOW = Instant(0)


def made(
    number: int,
    member: Member,
    *,
    left: bool = False,
    given_up: bool = False,
    ready: bool = False,
    link: LinkState = LinkState.CONNECTED,
) -> Vehicle:
    vehicle = Vehicle(VehicleId(1, number), number - 1, ArduPlane(number, ORIGIN, 0.25), Connection(number - 1), 10.0)
    if left:
        vehicle.leave_to_pilot(NOW)
    vehicle.start_up.abandoned = vehicle.start_up.abandoned or given_up
    if ready:
        vehicle.start_up = StartUp((), index=0)
    vehicle.member, vehicle.connection.state = member, link
    return vehicle


def may_begin(*vehicles: Vehicle, leads: bool = False) -> bool:
    roles: list[dict[str, Any]] = [{"id": each.identity.system, "role": "follower"} for each in vehicles]
    if leads:
        roles[0]["role"] = "leader"
    return Beginning(load_scenario(scenario(vehicles=roles)), {each.identity: each for each in vehicles}).may_begin(NOW)


def flying(number: int) -> Vehicle:
    return made(number, Member.FLYING)


@pytest.mark.parametrize("member", [Member.STARTING, Member.NO_LINK, Member.HOLDING, Member.RETURNING])
def test_under_a_virtual_leader_all_are_waited_for(member: Member) -> None:
    assert may_begin(flying(1), flying(2), flying(3))
    assert not may_begin(flying(1), made(2, member), flying(3))


@pytest.mark.parametrize(
    "out", [made(2, Member.STARTING, left=True), made(2, Member.STARTING, given_up=True), made(2, Member.PARTED)]
)
def test_but_those_that_are_given_up_or_their_pilots(out: Vehicle) -> None:
    assert may_begin(flying(1), out, flying(3))
    assert not may_begin(made(1, Member.STARTING), out, flying(3))


def test_one_that_its_pilot_has_given_back_is_waited_for_again_until_it_is_in_the_formation() -> None:
    back = made(2, Member.STARTING, left=True)
    back.start_up = StartUp((), index=0, abandoned=True, left=True)
    assert not may_begin(flying(1), back)
    back.member = Member.FLYING
    assert may_begin(flying(1), back)


@pytest.mark.parametrize("link", [LinkState.STALE, LinkState.MUTE])
def test_one_that_was_ready_is_waited_for_until_its_link_is_lost(link: LinkState) -> None:
    assert not may_begin(flying(1), made(2, Member.HOLDING, ready=True, link=link))
    assert may_begin(flying(1), made(2, Member.HOLDING, ready=True, link=LinkState.LOST))


def test_one_that_is_lost_before_it_is_ready_is_waited_for_until_it_is_given_up() -> None:
    assert not may_begin(flying(1), made(2, Member.STARTING, link=LinkState.LOST))
    assert may_begin(flying(1), made(2, Member.STARTING, link=LinkState.LOST, given_up=True))


def test_as_long_as_there_is_one() -> None:
    assert not may_begin(made(1, Member.PARTED), made(2, Member.STARTING, left=True))


def test_a_leader_is_waited_for_whoever_has_it_and_nobody_else() -> None:
    assert may_begin(flying(1), made(2, Member.STARTING), leads=True)
    assert not may_begin(made(1, Member.PARTED), flying(2), leads=True)
