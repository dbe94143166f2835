"""When all vehicles count as down, and what is said of each; vehicles are mere telemetry here."""

from __future__ import annotations

from types import SimpleNamespace
from typing import Any

import pytest

from airlink.clock import Instant, after
from airlink.endpoint import VehicleId
from gcs_formation.features.all_down.feature import FEATURE
from gcs_formation.features.all_down.watch import AllDown
from gcs_formation.phases import OVER, Phase
from tests.gcs_formation.event_log import GivenUp

DOWN = "all vehicles are down before the flight is over ({})"
ALL = (1, 2, 3)


class Fleet:
    """Three vehicles that fly, and are looked at each second."""

    def __init__(self) -> None:
        self.now, self.failed = Instant(0), GivenUp()
        self.vehicles = {VehicleId(1, number): self.vehicle(number) for number in ALL}
        findings = SimpleNamespace(silent_aloft=[VehicleId(9, 9)], crashed=frozenset[VehicleId]())
        cycle: Any = SimpleNamespace(
            vehicles=self.vehicles,
            findings=findings,
            flight=SimpleNamespace(phase=Phase.FLYING, ended=False),
            phase_machine=SimpleNamespace(fail=self.failed),
        )
        self.cycle, self.stage = cycle, AllDown(cycle)

    @staticmethod
    def vehicle(number: int) -> Any:
        return SimpleNamespace(
            identity=VehicleId(1, number),
            flew=True,
            may_fly=True,
            connection=SimpleNamespace(talks=True),
            start_up=SimpleNamespace(abandoned=False),
            telemetry=SimpleNamespace(armed=True),
        )

    def of(self, number: int) -> Any:
        """Return one of them."""
        return self.vehicles[VehicleId(1, number)]

    def on_ground(self, *numbers: int, armed: bool = False) -> None:
        """Let some be on the ground."""
        for number in numbers:
            each = self.of(number)
            each.flew = each.may_fly = False
            each.telemetry.armed = armed

    def silent(self, *numbers: int, talks: bool = False) -> None:
        """Let nothing be heard of some."""
        for number in numbers:
            self.of(number).connection.talks = talks

    def crash(self, *numbers: int) -> None:
        """Let it be known that these, and no others, lie on the ground."""
        self.cycle.findings.crashed = frozenset(VehicleId(1, number) for number in numbers)

    def look(self, times: int) -> list[str]:
        """Look at all so often; return why the flight was given up, each time that it was."""
        begun = len(self.failed)
        for _ in range(times):
            self.now = after(self.now, 1.0)
            self.cycle.now = self.now
            self.stage.run(self.cycle)
        return list(self.failed[begun:])

    @property
    def silent_aloft(self) -> list[int]:
        """Numbers of the silent ones that were last received in the air, where all others are down."""
        return [each.system for each in self.cycle.findings.silent_aloft]


def test_a_flight_is_given_up_once_all_have_been_down_for_four_seconds() -> None:
    fleet = Fleet()
    assert fleet.look(3) == []
    fleet.on_ground(1, 2, 3)
    assert fleet.look(4) == []
    assert fleet.look(1) == [DOWN.format("disarmed: 1, 2, 3")]


def test_they_must_be_down_for_that_long_without_a_break() -> None:
    fleet = Fleet()
    fleet.look(1)
    fleet.on_ground(1, 2, 3)
    assert fleet.look(4) == []
    fleet.of(2).may_fly = True
    assert fleet.look(1) == []
    fleet.of(2).may_fly = False
    assert fleet.look(4) == []
    assert fleet.look(1) == [DOWN.format("disarmed: 1, 2, 3")]


@pytest.mark.parametrize("number", ALL)
def test_while_one_is_up_the_flight_goes_on(number: int) -> None:
    fleet = Fleet()
    fleet.look(1)
    fleet.on_ground(*{*ALL} - {number})
    assert fleet.look(20) == []
    assert fleet.silent_aloft == []


@pytest.mark.parametrize("abandoned", [(), (2,), ALL])
def test_before_any_has_flown_none_is_down(abandoned: tuple[int, ...]) -> None:
    fleet = Fleet()
    fleet.on_ground(*ALL)
    fleet.silent(*ALL)
    for number in abandoned:
        fleet.of(number).start_up.abandoned = True
    assert fleet.look(20) == []
    assert fleet.silent_aloft == []


@pytest.mark.parametrize("abandoned", [True, False])
def test_one_that_never_took_off_is_waited_for_unless_it_was_left_on_the_ground(abandoned: bool) -> None:
    fleet = Fleet()
    fleet.on_ground(3)
    fleet.of(3).start_up.abandoned = abandoned
    fleet.look(1)
    fleet.on_ground(1, 2)
    found = fleet.look(5)
    assert found == ([DOWN.format("disarmed: 1, 2; never took off: 3")] if abandoned else [])


@pytest.mark.parametrize("abandoned", [True, False])
def test_one_that_was_left_on_the_ground_and_flies_is_up(abandoned: bool) -> None:
    fleet = Fleet()
    fleet.of(3).start_up.abandoned = abandoned
    fleet.look(1)
    fleet.on_ground(1, 2)
    assert fleet.look(20) == []


def test_silence_in_the_air_is_waited_for_and_who_is_silent_there_is_found() -> None:
    fleet = Fleet()
    fleet.look(1)
    fleet.on_ground(1)
    assert fleet.silent_aloft == []
    fleet.silent(2, 3)
    assert fleet.look(20) == []
    assert fleet.silent_aloft == [2, 3]
    fleet.silent(3, talks=True)
    assert fleet.look(1) == []
    assert fleet.silent_aloft == [], "one is heard, so the others' silence says nothing"


def test_silent_ones_that_lie_on_the_ground_are_down_if_all_do() -> None:
    fleet = Fleet()
    fleet.look(1)
    fleet.on_ground(1)
    fleet.silent(2, 3)
    fleet.crash(3)
    assert fleet.look(20) == []
    fleet.crash(2, 3)
    assert fleet.look(4) == []
    assert fleet.look(1) == [DOWN.format("disarmed: 1; silent on the ground: 2, 3")]


def test_one_that_lies_on_the_ground_and_is_heard_in_the_air_is_up() -> None:
    fleet = Fleet()
    fleet.look(1)
    fleet.on_ground(1, 2)
    fleet.crash(3)
    assert fleet.look(20) == []


def test_armed_ones_on_the_ground_have_landed() -> None:
    fleet = Fleet()
    fleet.look(1)
    fleet.on_ground(1, 3, armed=True)
    fleet.on_ground(2)
    assert fleet.look(5) == [DOWN.format("landed: 1, 3; disarmed: 2")]


@pytest.mark.parametrize("phase", [*OVER, None])
def test_once_the_flight_ends_anyway_it_is_not_given_up(phase: Phase | None) -> None:
    fleet = Fleet()
    fleet.look(1)
    fleet.on_ground(*ALL)
    if phase is None:
        fleet.cycle.flight.ended = True
    else:
        fleet.cycle.flight.phase = phase
    assert fleet.look(20) == []


@pytest.mark.parametrize("phase", [each for each in Phase if each not in (*OVER, Phase.DONE, Phase.FAILED)])
def test_in_all_phases_before_it_is(phase: Phase) -> None:
    fleet = Fleet()
    fleet.cycle.flight.phase = phase
    fleet.look(1)
    fleet.on_ground(*ALL)
    assert len(fleet.look(5)) == 1


def test_the_feature_is_this_stage() -> None:
    (stage,) = FEATURE.stages(Fleet().cycle)
    assert isinstance(stage, AllDown)
