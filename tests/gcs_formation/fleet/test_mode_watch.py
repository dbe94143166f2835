"""A mode that our commands led to, and another one that heartbeats show after it."""

from types import SimpleNamespace
from typing import Any

import pytest

from airlink.clock import Instant
from gcs_formation.fleet.mode_watch import ModeWatch
from gcs_formation.vehicle.command_delivery import EffectWatch, Outcome

LOITER, FBWA, GUIDED = 12, 5, 15
NOW = Instant(0)


@pytest.fixture
def vehicle() -> Any:
    """Return a vehicle in the air that has accepted its last list of commands."""
    seen = SimpleNamespace(custom_mode=LOITER, heartbeats=10, boots=False)
    commands = SimpleNamespace(outcome=Outcome.ACCEPTED, lists=3)
    return SimpleNamespace(identity=1, telemetry=seen, commands=commands, effects=EffectWatch(), airborne=True)


def shown(vehicle: Any, *modes: int) -> list[bool]:
    """Return after each heartbeat with one of the modes whether it is taken over, having asked between them, too."""
    watch, found = ModeWatch(), list[bool]()
    for mode in modes:
        vehicle.telemetry.custom_mode = mode
        vehicle.telemetry.heartbeats += 1
        found.append(watch.is_taken_over(vehicle, NOW))
        assert watch.is_taken_over(vehicle, NOW) is found[-1], "a heartbeat counts once"
    return found


def test_another_mode_in_two_heartbeats_after_two_of_ours_is_somebody_elses(vehicle: Any) -> None:
    assert shown(vehicle, LOITER, LOITER, LOITER, FBWA, FBWA) == [False, False, False, False, True]


def test_one_heartbeat_may_be_of_a_restart(vehicle: Any) -> None:
    assert not any(shown(vehicle, LOITER, LOITER, LOITER, FBWA, LOITER, FBWA))


def test_heartbeats_that_left_before_the_command_acted_are_of_the_mode_before(vehicle: Any) -> None:
    assert not any(shown(vehicle, GUIDED, LOITER, LOITER))
    assert shown(vehicle, GUIDED, GUIDED, LOITER, LOITER)[-1], "by then it was a mode of its own"


def test_another_list_of_commands_may_change_the_mode(vehicle: Any) -> None:
    watch = ModeWatch()
    for mode, lists in ((LOITER, 3), (LOITER, 3), (LOITER, 3), (FBWA, 4), (FBWA, 4), (FBWA, 4)):
        vehicle.telemetry.custom_mode, vehicle.commands.lists = mode, lists
        vehicle.telemetry.heartbeats += 1
        assert not watch.is_taken_over(vehicle, NOW)


@pytest.mark.parametrize(
    ("of", "name", "value"),
    [
        ("commands", "outcome", Outcome.WAITING),
        ("telemetry", "boots", True),
        ("telemetry", "custom_mode", None),
        (None, "airborne", False),
    ],
)
def test_what_is_not_carried_out_or_not_in_the_air_shows_nothing(vehicle: Any, of: str, name: str, value: Any) -> None:
    watch = ModeWatch()
    for mode in (LOITER, LOITER, LOITER, FBWA):
        vehicle.telemetry.custom_mode = mode
        vehicle.telemetry.heartbeats += 1
        assert not watch.is_taken_over(vehicle, NOW)
    vehicle.telemetry.heartbeats += 1
    setattr(vehicle if of is None else getattr(vehicle, of), name, value)
    assert not watch.is_taken_over(vehicle, NOW)


def test_one_that_acknowledged_and_obeys_late_is_not_taken_over(vehicle: Any) -> None:
    effect: Any = SimpleNamespace(expected=LOITER, shown=lambda seen: seen.custom_mode, description="mode LOITER")
    vehicle.telemetry.custom_mode = GUIDED
    vehicle.effects.acknowledged(effect, vehicle.telemetry, NOW)
    assert not any(shown(vehicle, GUIDED, GUIDED, GUIDED, LOITER, LOITER))
