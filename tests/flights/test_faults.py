"""Consequences of each fault, and their times: the rows of docs/safety-figures.md, under the virtual clock."""

from __future__ import annotations

import errno
import json
import signal
from pathlib import Path
from typing import Any

import numpy as np
import pytest
import yaml
from click.testing import CliRunner
from hypothesis import given, settings
from hypothesis import strategies as st

from airlink.clock import Instant
from airlink.engine import Datagram
from airlink.messages.command import CommandLong, SetMode
from airlink.stream_parser import StreamParser
from formation_scenario import load_scenario
from formation_scenario.surroundings import FaultKind
from gcs_formation.app.operator_at_terminal import Interrupts
from gcs_formation.app.progress import Progress
from gcs_formation.app.run import run
from gcs_formation.app.run_options import RunOptions
from gcs_formation.cli import main
from gcs_formation.errors import RunAbortedError
from gcs_formation.phases import Cause, Phase
from gcs_formation.record.parquet import read_parquet
from gcs_formation.record.run_directory import RunDirectory
from gcs_formation.recorder import Event
from sim_vehicles.autopilot.modes_and_failsafe import Condition, Mode
from sim_vehicles.fleet import Fleet
from tests.flights.conftest import Fly, scenario
from tests.flights.in_memory import Between, HeldUp, World

LAG_S = 0.2
"""Two ticks: how much an event may lag behind its cause."""
PREDICTED = {"in_air": True, "run_in_s": 10}
"""Long enough over 300 ms each way; with less the leader flies another lap of 90 s."""


def flying(kind: FaultKind, number: int, at_s: float = 2.0, **keys: Any) -> tuple[World, float]:
    """Return a world in which a fault has just begun, and when it did."""
    world = World(duration_s=keys.pop("duration_s", 60), **keys)
    world.fly_to(at_s)
    world.inject(number, kind)
    return world, world.now_s


@pytest.mark.slow
@pytest.mark.parametrize("kind", ["crash", "freeze"])
def test_a_silent_follower_is_given_up_step_by_step_and_the_others_fly_on(kind: FaultKind) -> None:
    world, struck_s = flying(kind, 2, duration_s=35)
    world.run()
    (stale_s,), (lost_s,) = world.times_s("link", 2, "stale"), world.times_s("link", 2, "lost")
    (silent_s,), (commanded_s,) = world.times_s("member", 2, "not heard"), world.times_s("member", 2, "told to loiter")
    assert stale_s - struck_s == pytest.approx(1.5, abs=LAG_S)
    assert lost_s - struck_s == pytest.approx(5.0, abs=LAG_S)
    assert silent_s - struck_s == pytest.approx(5.0, abs=LAG_S)
    assert commanded_s - struck_s == pytest.approx(30.0, abs=LAG_S)
    assert world.times_s("member", 3, "told to loiter") == []
    assert max(max(map(abs, tick.error_m[2])) for tick in world.recorder.ticks if tick.mission_time_s > 2.0) < 0.05
    assert world.station.flight.phase is Phase.DONE


def test_a_follower_that_hangs_and_comes_back_flies_in_its_slot_again() -> None:
    world, _ = flying("freeze", 2, duration_s=25)
    world.run(6.0)
    world.inject(2, "freeze", ends=True)
    back_s = world.now_s
    world.run()
    (again_s,) = [at_s for at_s in world.times_s("member", 2, "flying") if at_s > back_s]
    assert again_s - back_s < 1.5
    assert world.worst_m(22.0) < 0.1


@pytest.mark.parametrize("stopped_s", [2.0, pytest.param(4.0, marks=pytest.mark.slow)])
def test_vehicles_that_are_held_up_are_not_taken_for_restarted_ones(stopped_s: float) -> None:
    world = World(HeldUp, duration_s=30)
    world.fly_to(3.0)
    assert isinstance(world.between, HeldUp)
    world.between.stop(world.clock.now(), stopped_s)
    world.run()
    assert world.words("restarted") == []
    assert world.words("leader") == []
    assert world.words("member") == ["flying in formation"] * 3
    assert world.worst_m(25.0) < 0.1


@pytest.mark.parametrize("number", [1, pytest.param(2, marks=pytest.mark.slow)])
def test_a_restart_in_flight_is_taken_up_again(number: int) -> None:
    world, struck_s = flying("restart", number, duration_s=18)
    world.run()
    (restarted_s,) = world.times_s("restarted", number)
    (again_s,) = [at_s for at_s in world.times_s("ready", number) if at_s > struck_s]
    assert restarted_s - struck_s < 0.5
    assert not world.times_s("member", number, "pilot"), "a mode that it boots in is nobody's choice"
    assert again_s - struck_s < 6.0
    assert world.worst_m(14.0) < 0.1
    assert world.station.phase_machine.failure is None


@pytest.mark.slow
@pytest.mark.parametrize("number", [1, 2])
def test_a_restart_on_the_ground_is_left_to_the_pilot_until_it_flies_and_is_given_back(number: int) -> None:
    world = World(duration_s=60)
    world.fly_to(2.0)
    vehicle = world.vehicle(number)
    vehicle.pilot.condition = Condition.DISARMED
    vehicle.body.ground()
    vehicle.enter(Mode.MANUAL)
    world.inject(number, "restart")
    world.run(25.0)
    assert len(world.times_s("abandoned", number, "left to its pilot")) == 1
    assert vehicle.pilot.condition is Condition.DISARMED
    assert vehicle.pilot.mode is Mode.MANUAL
    vehicle.enter(Mode.TAKEOFF)
    vehicle.arm(force=True)
    world.run(10.0)
    assert vehicle.pilot.condition is Condition.FLYING
    assert vehicle.pilot.mode is Mode.TAKEOFF
    world.inject(number, "pilot", ends=True)
    back_s = world.now_s
    world.run(5.0)
    (again_s,) = [at_s for at_s in world.times_s("ready", number) if at_s > back_s]
    assert again_s - back_s < LAG_S
    assert world.station.phase_machine.failure is None


@pytest.mark.parametrize("kind", ["crash", pytest.param("freeze", marks=pytest.mark.slow)])
def test_followers_of_a_silent_leader_are_commanded_to_loiter_at_separate_heights(kind: FaultKind) -> None:
    world, struck_s = flying(kind, 1, duration_s=18, formation={"shape": "arrow", "succession": "none"})
    world.run()
    for number in (2, 3):
        (commanded_s,) = world.times_s("member", number, "told to loiter")
        assert commanded_s - struck_s == pytest.approx(5.0, abs=LAG_S)
        assert world.times_s("mode", number, "LOITER")[0] - struck_s < 5.5
    heights_m = [body.state.height_m for body in world.fleet.bodies[1:]]
    assert abs(heights_m[0] - heights_m[1]) > 10.0


@pytest.mark.parametrize("mode", ["FBWA", *(pytest.param(mode, marks=pytest.mark.slow) for mode in ("LOITER", "RTL"))])
def test_a_pilots_switch_is_respected_and_ends_when_the_pilot_gives_it_back(mode: str) -> None:
    world = World(duration_s=15)
    world.fly_to(2.0)
    world.inject(2, "pilot", mode=mode)
    taken_s = world.now_s
    world.run(6.0)
    assert world.vehicle(2).pilot.mode is Mode[mode]
    world.inject(2, "pilot", ends=True)
    back_s = world.now_s
    world.run(None if mode == "FBWA" else 2.0)
    (parted_s,) = world.times_s("member", 2, "parted")
    (again_s,) = [at_s for at_s in world.times_s("member", 2, "flying") if at_s > taken_s]
    assert parted_s - taken_s < LAG_S
    assert again_s - back_s < LAG_S
    assert world.times_s("disobeys") == []
    assert mode != "FBWA" or world.worst_m(13.0) < 1.0  # after FBWA it is far behind the others


@pytest.mark.parametrize("kind", ["pilot", pytest.param("restart", marks=pytest.mark.slow)])
def test_a_leader_that_can_not_lead_any_more_is_succeeded_at_once_and_follows_when_it_can(kind: FaultKind) -> None:
    world, struck_s = flying(kind, 1, duration_s=9)
    world.run(4.0)
    world.inject(1, "pilot", ends=True)
    world.run()
    (leads_s,) = world.times_s("leader", 2)
    assert leads_s - struck_s < 0.25 + LAG_S
    assert world.times_s("member", 1, "flying")[-1] > leads_s
    assert world.times_s("leader") == [leads_s]
    assert not world.times_s("member", 2) or world.times_s("member", 2)[-1] < struck_s
    assert not world.times_s("member", 3, "loiter")


@pytest.mark.parametrize("kind", ["pilot", pytest.param("restart", marks=pytest.mark.slow)])
def test_without_succession_followers_loiter_until_the_leader_is_back(kind: FaultKind) -> None:
    world, struck_s = flying(kind, 1, duration_s=12, formation={"shape": "arrow", "succession": "none"})
    world.run(5.0)
    world.inject(1, "pilot", ends=True)
    world.run()
    (back_s,) = [at_s for at_s in world.times_s("member", 1, "flying") if at_s > struck_s]
    for number in (2, 3):
        assert world.times_s("member", number, "told to loiter") == [pytest.approx(struck_s, abs=0.25 + LAG_S)]
        assert world.times_s("member", number, "told to come back") == [pytest.approx(back_s, abs=LAG_S)]
        (again_s,) = [at_s for at_s in world.times_s("member", number, "flying") if at_s > struck_s]
        assert again_s - back_s == pytest.approx(0.2, abs=LAG_S)


@pytest.mark.parametrize(
    "moment_s", [3.0, *(pytest.param(s, marks=pytest.mark.slow) for s in (3.06, 3.12, 3.18, 3.24))]
)
@pytest.mark.parametrize("delay_ms", [0, 300])
def test_a_station_that_is_stopped_does_not_take_its_own_pause_for_delay(moment_s: float, delay_ms: int) -> None:
    """It is stopped for 3 s, at different moments between two probes."""
    world = World(duration_s=30, start=PREDICTED, links={"default": {"delay_ms": delay_ms}})
    world.fly_to(moment_s)
    world.process.stop(world.clock.now(), 3.0)
    world.run(8.0)
    for vehicle in world.station.vehicles.values():
        halves_s = np.frombuffer(vehicle.round_trips.delays.getvalue())[1::4]
        assert halves_s.max() < 0.001 * delay_ms + 0.011, "half of a turn of the answering loop"
        assert vehicle.jitter.jitter_s < 0.02
    assert not world.words("delay_margin")


@pytest.mark.slow
def test_an_order_to_loiter_that_arrives_after_the_link_is_back_is_taken_back(fly: Fly, tmp_path: Path) -> None:
    """Over 0.6 s of delay the last command to loiter arrives when the vehicle flies in the formation again."""
    outage = [{"at_s": 5, "vehicles": [3], "outage": True}, {"at_s": 35.5, "vehicles": [3], "outage": False}]
    fly(
        duration_s=42,
        start={"in_air": True, "run_in_s": 15},
        links={"default": {"delay_ms": 600}, "changes": outage},
    )
    lines = (tmp_path / "run" / "events.jsonl").read_text().splitlines()
    events = [event for event in map(json.loads, lines) if event.get("vehicle") == "3"]
    member = [event["text"] for event in events if event["kind"] == "member"]
    assert member == [
        "flying in formation",
        "not heard: told nothing until it is",
        "told to loiter",
        "flying in formation",
        "told to come back",
        "flying in formation",
    ]
    modes = [(event["text"], event["t_s"]) for event in events if event["kind"] == "mode"]
    assert [text for text, _ in modes] == ["GUIDED", "LOITER", "GUIDED", "LOITER"]
    assert modes[2][1] - modes[1][1] == pytest.approx(2 * 0.6, abs=LAG_S), "revoked before it was shown"


@pytest.mark.slow
@settings(max_examples=12)
@given(at_s=st.floats(0.0, 60.0))
def test_stopped_at_any_moment_vehicles_loiter_or_are_disarmed(at_s: float) -> None:
    world = World(start={"in_air": False}, duration_s=20)
    world.run(at_s + 0.01)
    world.station.phase_machine.stop(world.clock.now())
    world.run()
    assert world.station.flight.phase is Phase.DONE
    for vehicle in world.fleet.vehicles:
        assert vehicle.pilot.mode is Mode.LOITER if vehicle.pilot.airborne else not vehicle.pilot.condition.armed


class Unanswering(Between):
    """Emulators of which one, from some time on, neither carries out commands and modes nor answers them."""

    def __init__(self, fleet: Fleet) -> None:
        super().__init__(fleet)
        self.number: int | None = None

    def take(self, datagram: Datagram, now: Instant) -> None:
        messages = [frame.message for frame in StreamParser().feed(datagram.data)]
        orders = [each for each in messages if isinstance(each, CommandLong | SetMode)]
        if all(each.target_system != self.number for each in orders):
            super().take(datagram, now)


@pytest.mark.slow
def test_a_vehicle_that_never_acknowledges_that_it_loiters_is_waited_for_for_20_s_and_named() -> None:
    world = World(Unanswering, duration_s=60)
    world.fly_to(2.0)
    assert isinstance(world.between, Unanswering)
    world.between.number = 3
    world.station.phase_machine.stop(world.clock.now())
    world.run()
    (named_s,), (loitering_s,) = world.times_s("unacknowledged", 3), world.times_s("phase", text="loitering")
    assert named_s - loitering_s == pytest.approx(20.0, abs=LAG_S)
    assert world.times_s("unacknowledged") == [named_s]
    assert world.station.flight.phase is Phase.DONE


def test_a_vehicle_that_acknowledges_to_loiter_and_does_not_is_not_said_to() -> None:
    world = World(duration_s=3, finish={"loiter_s": 10})
    world.fly_to(2.0)
    world.inject(3, "ignore")
    world.run()
    (done,) = [event for event in world.recorder.events if event.text == "done"]
    assert str(done.details["cause"]).startswith("not every vehicle loiters")


SIGNALS = [
    ([signal.SIGTERM], ["LOITER"] * 2, Cause.LOITERED),
    ([signal.SIGINT], ["LOITER"] * 2, Cause.LOITERED),
    ([signal.SIGINT] * 2, ["RTL"] * 2, Cause.HOMEWARD),
    ([signal.SIGINT] * 3, [], Cause.IMMEDIATE_RETURN),
]


@pytest.mark.parametrize(("signals", "modes", "last"), SIGNALS)
def test_a_signal_has_everyone_loiter_a_second_one_go_home_at_once_and_a_third_one_is_the_end(
    signals: list[signal.Signals], modes: list[str], last: Cause, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    out, event, left = tmp_path / "run", RunDirectory.event, list(signals)

    def raising(self: RunDirectory, happened: Event) -> None:
        event(self, happened)
        while happened.text == "flying" and left:
            signal.raise_signal(left.pop())

    monkeypatch.setattr(RunDirectory, "event", raising)
    file = tmp_path / "short.yaml"
    file.write_text(yaml.safe_dump(scenario(duration_s=60, vehicles={"count": 2})))
    result = CliRunner().invoke(main, ["run", str(file), "--clock", "virtual", "--out", str(out), "--quiet"])
    assert result.exit_code == 130
    events = [json.loads(line) for line in (out / "events.jsonl").read_text().splitlines()]
    assert [event["text"] for event in events if event["kind"] == "mode" and event["text"] != "GUIDED"] == modes
    assert [event["cause"] for event in events if event["kind"] == "phase"][-1] == last.value
    assert len(read_parquet(out / "timeseries.parquet")["t_s"]) > 0


def test_a_full_disk_ends_the_run_with_vehicles_loitering(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    interrupts, out = Interrupts(), tmp_path / "run"
    record, frames = RunDirectory.frames, 0

    def full(self: RunDirectory, now: Any, raws: list[bytes]) -> None:
        nonlocal frames
        frames += len(raws)
        if frames >= 2000 > frames - len(raws):
            assert self._tlog is not None
            self._tlog._file.close()
            monkeypatch.setattr(self._tlog, "_file", Full())
        record(self, now, raws)

    monkeypatch.setattr(RunDirectory, "frames", full)
    with pytest.raises(RunAbortedError, match=r"cannot go on recording in .*: No space left on device"):
        run(load_scenario(scenario(duration_s=60)), RunOptions(out, "virtual"), Progress(), interrupts)
    events = [json.loads(line) for line in (out / "events.jsonl").read_text().splitlines()]
    assert sum(event["kind"] == "mode" and event["text"] == "LOITER" for event in events) == 3
    assert events[-1]["text"] == "failed"


class Full:
    """A file on a full disk."""

    def write(self, data: bytes) -> int:
        raise OSError(errno.ENOSPC, "No space left on device")

    flush = close = lambda self: self.write(b"")
