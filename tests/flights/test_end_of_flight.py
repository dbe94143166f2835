"""The end of a flight: others keep clear of a vehicle that doesn't hear, whatever ends the flight; all of it counts."""

from __future__ import annotations

import json
import math
from collections.abc import Callable
from pathlib import Path
from typing import Any, cast

import numpy as np
import pytest
import yaml
from click.testing import CliRunner

from airlink import mavlink as m
from airlink.clock import Instant
from airlink.engine import Datagram
from airlink.messages.command import CommandAck, CommandLong
from airlink.messages.telemetry import GlobalPositionInt
from airlink.stream_parser import StreamParser
from gcs_formation.cli import main
from gcs_formation.features.ending.ending import SeparatedEnding
from gcs_formation.phases import Cause, Phase
from sim_vehicles.autopilot.modes_and_failsafe import Mode
from sim_vehicles.fleet import Fleet
from tests.flights.conftest import STRAIGHT, Fly, scenario
from tests.flights.in_memory import Between, World

END_S = 12.0
START = {"in_air": True, "run_in_s": 10}
BESIDE = {"vehicles": {"count": 3}, "formation": {"shape": "custom", "slots_m": {2: [-5, 20, 0], 3: [-30, -30, 0]}}}
"""A formation in which a vehicle that flies straight on crosses the others' circles on its right."""


def out(way: str, begins_s: float, ends_s: float, vehicle: int = 2) -> dict[str, Any]:
    """Return links of which one is out for a while: `uplink`, `downlink` or both."""
    states = [{"outage": gone} if way == "both" else {way: {"outage": gone}} for gone in (True, False)]
    times_s = begins_s, ends_s
    return {
        "changes": [{"at_s": at_s, "vehicles": [vehicle]} | keys for at_s, keys in zip(times_s, states, strict=True)]
    }


@pytest.mark.slow
def test_others_circle_only_where_one_that_does_not_receive_does_not_fly_straight_on(fly: Fly, tmp_path: Path) -> None:
    """Vehicles used to be told to loiter at once; two of them then came within 1 m of each other 4.6 s later."""
    links = out("uplink", END_S - 0.5, END_S + 9.0)
    safety = fly(**BESIDE, duration_s=END_S, start=START, links=links).to_dict()["safety"]
    assert safety["min_separation_m"] > 20.0
    assert safety["violations"] == 0
    events = [json.loads(line) for line in (tmp_path / "run" / "events.jsonl").read_text().splitlines()]
    begins_s = {event["text"]: event["t_s"] for event in events if event["kind"] == "phase"}
    loiters_s = [event["t_s"] for event in events if event["kind"] == "mode" and event["text"] == "LOITER"]
    assert min(loiters_s) - begins_s["ending"] > 7.0, "10 m are climbed, or sunk, in no less"
    assert begins_s["done"] - begins_s["loitering"] < 2.2


def test_a_pair_that_is_stopped_loiters_after_5_s() -> None:
    world = World(vehicles={"count": 2})
    world.fly_to(1.0)
    world.station.phase_machine.stop(world.clock.now())
    stopped_s = world.now_s
    world.run()
    commanded_s = [world.times_s("mode", number, "LOITER")[0] - stopped_s for number in (1, 2)]
    assert 4.5 < min(commanded_s) <= max(commanded_s) < 6.0


def test_they_circle_once_all_are_apart_however_long_the_climb_takes() -> None:
    """At 0.5 m/s, a sixth of the usual climb rate, 15 m take half a minute."""
    world = World(vehicles={"count": 2, "model": {"climb_max_mps": 0.5}}, finish={"loiter_s": 0})
    world.fly_to(1.0)
    world.station.phase_machine.stop(world.clock.now())
    world.network.run(lambda: world.station.flight.phase is Phase.LOITERING)
    heights_m = sorted(body.state.height_m for body in world.fleet.bodies)
    assert np.diff(heights_m).min() > 9.9


@pytest.mark.slow
def test_circles_in_rough_air_are_as_far_apart_as_it_asks_for() -> None:
    """Turbulence of a wind of 15 m/s moves vehicles off their heights by over 4 m: circles 15 m apart would meet."""
    rough = {"kind": "dryden", "at_s": 0, "vehicles": "all", "wind_6m_mps": 15.0}
    world = World(vehicles={"count": 3}, disturbances=[rough], finish={"loiter_s": 0})
    world.fly_to(10.0)
    sway_m = world.station.controller.estimator.sway_m
    assert 1.0 < sway_m < 8.0
    world.station.phase_machine.stop(world.clock.now())
    world.network.run(lambda: world.station.flight.phase is Phase.LOITERING)
    world.run()
    wanted_m = sorted(body.steering.height_m for body in world.fleet.bodies)
    assert np.diff(wanted_m).min() > 10.0 + 0.9 * 4.0 * math.hypot(sway_m, sway_m) > 16.0


@pytest.mark.parametrize("phase", [Phase.ENDING, Phase.LOITERING])
def test_commanded_to_stop_once_more_all_go_home_at_once_at_separate_heights(phase: Phase) -> None:
    world = World(vehicles={"count": 2}, finish={"loiter_s": 0})
    world.fly_to(1.0)
    world.station.phase_machine.stop(world.clock.now())
    world.network.run(lambda: world.station.flight.phase is phase)
    again_s = world.now_s
    assert world.station.phase_machine.go_home_at_once(world.clock.now())
    world.run()
    commanded_s = [world.times_s("mode", number, "RTL")[0] - again_s for number in (1, 2)]
    assert max(commanded_s) < 0.3
    assert not world.station.phase_machine.go_home_at_once(world.clock.now())
    wanted_m = [body.steering.height_m for body in world.fleet.bodies]
    assert abs(wanted_m[0] - wanted_m[1]) >= 15.0


class Deaf(Between):
    """Emulators of which some never carry out some commands, and answer with another result.

    One hides its position. Commands to all, besides setpoints and message intervals, are kept.
    """

    def __init__(self, fleet: Fleet) -> None:
        super().__init__(fleet)
        self.refuse: Callable[[CommandLong], int | None] = lambda _: None
        self.hidden: int | None = None
        self.commands: list[CommandLong] = []

    def take(self, datagram: Datagram, now: Instant) -> None:
        for frame in StreamParser().feed(datagram.data):
            command = frame.message
            if isinstance(command, CommandLong) and command.command != m.MAV_CMD_SET_MESSAGE_INTERVAL:
                self.commands.append(command)
                result = self.refuse(command)
                if result is not None:
                    answering = self.fleet.vehicles[command.target_system - 1].link
                    answering.answer(datagram.peer, CommandAck(command.command, result))
                    return
        super().take(datagram, now)

    def datagrams_to_send(self) -> list[Datagram]:
        return [each for each in super().datagrams_to_send() if not self._hides(each)]

    def _hides(self, datagram: Datagram) -> bool:
        frames = StreamParser().feed(datagram.data)
        return any(each.system == self.hidden and isinstance(each.message, GlobalPositionInt) for each in frames)

    def disarmed(self) -> list[int]:
        """Return which vehicles were told to disarm."""
        return [each.target_system for each in self.commands if each.command == m.MAV_CMD_COMPONENT_ARM_DISARM]


@pytest.mark.parametrize("hides", [False, True])
def test_one_that_restarts_just_before_the_end_is_commanded_to_circle_and_never_to_disarm(hides: bool) -> None:
    """It flies at 100 m, but hasn't sent a position yet, and may never do so."""
    world = World(Deaf, duration_s=60)
    world.fly_to(2.0)
    between = cast("Deaf", world.between)
    between.hidden = 2 if hides else None
    world.inject(2, "restart")
    world.network.run(lambda: bool(world.times_s("restarted", 2)))
    world.station.phase_machine.stop(world.clock.now())
    world.run()
    assert between.disarmed() == []
    assert [each.pilot.mode for each in world.fleet.vehicles] == [Mode.LOITER] * 3
    assert world.times_s("phase", text="done")
    assert len(world.times_s("unacknowledged", 2)) == hides, "without a place it has no height of its own"


@pytest.mark.parametrize("result", [m.MAV_RESULT_DENIED, m.MAV_RESULT_UNSUPPORTED, m.MAV_RESULT_COMMAND_INT_ONLY])
def test_one_that_refuses_to_loiter_is_commanded_again_and_the_run_says_so(result: int) -> None:
    world = World(Deaf, duration_s=60)
    world.fly_to(2.0)
    between = cast("Deaf", world.between)
    between.refuse = lambda command: result if (command.target_system, command.param2) == (2, Mode.LOITER) else None
    world.station.phase_machine.stop(world.clock.now())
    world.run()
    tries = [each for each in between.commands if (each.target_system, each.param2) == (2, Mode.LOITER)]
    assert 6 <= len(tries) <= 8, "every 3 s for 20 s"
    assert len(world.times_s("disobeys", 2, "refuses mode LOITER")) == len(world.times_s("unacknowledged", 2)) == 1
    assert world.times_s("unacknowledged") == world.times_s("unacknowledged", 2)
    (done,) = [event for event in world.recorder.events if event.text == "done"]
    assert done.details["cause"] == Cause.NOT_ALL_LOITERED.value


def test_one_that_refuses_to_loiter_at_first_does_so_once_it_can() -> None:
    world = World(Deaf, duration_s=60)
    world.fly_to(2.0)
    between = cast("Deaf", world.between)
    between.refuse = lambda command: (
        m.MAV_RESULT_DENIED if (command.target_system, command.param2) == (2, Mode.LOITER) else None
    )
    world.station.phase_machine.stop(world.clock.now())
    world.network.run(lambda: bool(world.times_s("disobeys", 2)))
    between.refuse = lambda _: None
    world.run()
    assert world.vehicle(2).pilot.mode is Mode.LOITER
    assert world.words("obeys") == ["no longer refuses mode LOITER (DO_SET_MODE: DENIED)"]
    assert world.times_s("unacknowledged") == []


@pytest.mark.slow
def test_vehicles_that_refuse_their_heights_circle_where_they_are_instead_of_at_one_height_at_home() -> None:
    """Two came within 1.3 m of each other at home, while the run reported that every vehicle loiters."""
    world = World(Deaf, vehicles={"count": 4}, duration_s=60, finish={"loiter_s": 60})
    world.fly_to(2.0)
    between = cast("Deaf", world.between)
    between.refuse = lambda command: (
        m.MAV_RESULT_UNSUPPORTED if command.command == m.MAV_CMD_DO_CHANGE_ALTITUDE else None
    )
    assert world.station.orders.execute("rtl", world.clock.now()).accepted
    world.run()
    assert [each.pilot.mode for each in world.fleet.vehicles] == [Mode.LOITER] * 4
    assert not world.times_s("mode", text="RTL")
    heights_m = sorted(body.state.height_m for body in world.fleet.bodies)
    assert np.diff(heights_m).min() > 10.0
    assert len(world.times_s("disobeys", text="refuses DO_CHANGE_ALTITUDE: UNSUPPORTED")) == 4
    assert len(world.times_s("unacknowledged")) == 4


@pytest.mark.parametrize("opens", [True, False])
def test_vehicles_that_take_no_height_and_circle_at_one_are_named_as_unsafe(opens: bool) -> None:
    """When told to go home at once, it doesn't spread in height first; the run used to end without a fault."""
    world = World(Deaf, duration_s=60)
    world.fly_to(2.0)
    between = cast("Deaf", world.between)
    between.refuse = lambda command: (
        m.MAV_RESULT_UNSUPPORTED if command.command == m.MAV_CMD_DO_CHANGE_ALTITUDE else None
    )
    world.station.phase_machine.stop(world.clock.now())
    if not opens:
        world.run(1.0)
        assert world.station.phase_machine.go_home_at_once(world.clock.now())
    world.run()
    assert len(world.times_s("unacknowledged")) == 3
    unsafe = world.station.phase_machine.unsafe
    pairs = [] if opens else ["vehicles 1 and 2", "vehicles 1 and 3", "vehicles 2 and 3"]
    assert [text.split(" may ")[0] for text in unsafe] == pairs
    assert all("m apart: 1 refuses DO_CHANGE_ALTITUDE: UNSUPPORTED" in text for text in unsafe[:2])


def test_a_run_that_leaves_vehicles_at_one_height_exits_with_1_and_names_them(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    text = "vehicles 1 and 2 may circle at heights 0.1 m apart: 1 refuses DO_CHANGE_ALTITUDE: UNSUPPORTED"
    monkeypatch.setattr(SeparatedEnding, "at_one_height", lambda _: [text])
    file = tmp_path / "short.yaml"
    file.write_text(yaml.safe_dump(scenario(duration_s=2, vehicles={"count": 2})))
    out = tmp_path / "run"
    result = CliRunner().invoke(main, ["run", str(file), "--clock", "virtual", "--out", str(out), "--quiet"])
    assert result.exit_code == 1
    assert f"safety broken: {text}" in result.stderr


def test_one_that_acknowledges_loiter_and_stays_in_guided_is_known_to_fly_on() -> None:
    world = World(duration_s=4, vehicles={"count": 2}, finish={"loiter_s": 3})
    world.fly_to(2.0)
    world.inject(2, "ignore")
    world.run()
    assert list(world.station.phase_machine.flying_on.values()) == ["vehicle 2 flies on in GUIDED"]


def test_one_that_refuses_to_go_home_circles_where_it_is() -> None:
    """It used to fly straight on with its last setpoint."""
    world = World(Deaf, duration_s=60, finish={"loiter_s": 5})
    world.fly_to(2.0)
    between = cast("Deaf", world.between)
    between.refuse = lambda command: (
        m.MAV_RESULT_DENIED if (command.target_system, command.param2) == (2, Mode.RTL) else None
    )
    assert world.station.orders.execute("rtl", world.clock.now()).accepted
    world.run()
    assert [each.pilot.mode for each in world.fleet.vehicles] == [Mode.RTL, Mode.LOITER, Mode.RTL]
    assert len(world.times_s("unacknowledged", 2)) == 1


GEOMETRIES: dict[str, dict[str, Any]] = {
    "beside": BESIDE,
    "line, 15 m": {"vehicles": {"count": 4}, "formation": {"shape": "line", "spacing_m": 15}},
    "square, 20 m": {"vehicles": {"count": 4}, "formation": {"shape": "square", "spacing_m": 20}},
    "line, 30 m": {"vehicles": {"count": 4}, "formation": {"shape": "line", "spacing_m": 30}},
    "triangle, 12 m": {"vehicles": {"count": 3}, "formation": {"shape": "triangle", "spacing_m": 12}},
}
FAULTS = ["uplink", "downlink", "both", "ignore", "crash", "restart", "pilot"]


@pytest.mark.slow
@pytest.mark.parametrize("fault", FAULTS)
@pytest.mark.parametrize("geometry", GEOMETRIES)
def test_none_comes_near_at_the_end_whatever_fails_then(fly: Fly, geometry: str, fault: str) -> None:
    for after_end_s in (-3.0, -0.5, 2.0, 6.0):
        begins_s, ends_s = END_S + after_end_s, END_S + after_end_s + 8.0
        keys: dict[str, Any] = {"links": out(fault, begins_s, ends_s)}
        if fault not in ("uplink", "downlink", "both"):
            lasts = {} if fault in ("crash", "restart") else {"until_s": ends_s}
            keys = {"faults": [{"at_s": begins_s, "vehicles": [2], "kind": fault} | lasts]}
        flight = GEOMETRIES[geometry] | keys
        safety = fly(**flight, duration_s=END_S, start=START, finish={"loiter_s": 12}, path=STRAIGHT).to_dict()[
            "safety"
        ]
        assert safety["min_separation_m"] > 7.0, f"{fault} {after_end_s} s after the end"


def test_one_that_restarts_while_the_others_circle_is_commanded_to_circle_again() -> None:
    """It reboots into MANUAL and flies straight on, but had acknowledged LOITER before."""
    world = World(vehicles={"count": 2}, finish={"loiter_s": 30})
    world.fly_to(1.0)
    world.station.phase_machine.move(Cause.PATH_ENDED, world.clock.now())
    world.network.run(lambda: world.station.flight.phase is Phase.LOITERING)
    world.run(5.0)
    world.inject(2, "restart")
    world.run()
    assert len(world.times_s("mode", 2, "MANUAL")) == 1
    assert world.vehicle(2).pilot.mode is Mode.LOITER
    assert world.times_s("phase", text="done")
    wanted_m = [body.steering.height_m for body in world.fleet.bodies]
    assert abs(wanted_m[0] - wanted_m[1]) >= 15.0
