"""A ground station is killed in flight, and another takes over the vehicles from the first one's record."""

from __future__ import annotations

import signal
import subprocess
import time
from collections.abc import Callable, Generator
from pathlib import Path
from typing import Any

import numpy as np
import pytest
import yaml
from click.testing import CliRunner

from airlink import mavlink as m
from airlink.clock import MICROSECONDS, NANOSECONDS, Instant, seconds_between
from airlink.engine import Datagram
from airlink.frame import HEADER_V2
from airlink.messages.command import CommandLong
from airlink.messages.system import Heartbeat
from airlink.stream_parser import StreamParser
from formation_scenario import Scenario
from gcs_formation.app.fly import taken_up
from gcs_formation.app.run_options import RunOptions
from gcs_formation.cli import main
from gcs_formation.phases import Cause, Phase
from gcs_formation.record.parquet import read_parquet
from gcs_formation.record.run_directory import GOES_ON, RECORDING, SPOOL, RunDirectory
from gcs_formation.record.timeseries import Spool
from gcs_formation.record.tlog import read_tlog
from gcs_formation.record.unfinished import epoch_us, read_past
from gcs_formation.recorder import Event, Tick
from gcs_formation.station import Station
from sim_vehicles.autopilot.modes_and_failsafe import Condition, Mode
from sim_vehicles.fleet import Fleet
from tests.flights.conftest import scenario
from tests.flights.in_memory import Between, MemoryRecorder, World
from tests.processes import LIMIT_S, STATION, VEHICLES, events_of, free_ports, started, wait_for_event

EPOCH_US = 1_700_000_000_000_000
REGAINED_S = 60.0
SLOT_M = 0.5
BENDS = {"speed_mps": 22, "waypoints_m": [[0, 0, 100], [700, 0, 100], [1300, 500, 120], [1400, 2500, 120]]}


class Kept(MemoryRecorder):
    """A recorder in memory and in a run directory."""

    def __init__(self, scenario: Scenario, path: Path, *, resume: bool = False) -> None:
        super().__init__()
        columns = [each.vehicle_id for each in (scenario.leader, *scenario.followers) if each]
        self.directory = RunDirectory(path, scenario, columns, EPOCH_US, resume=resume)

    def frames(self, now: Instant, raws: list[bytes]) -> None:
        self.directory.frames(now, raws)

    def tick(self, tick: Tick) -> None:
        super().tick(tick)
        self.directory.tick(tick)

    def event(self, event: Event) -> None:
        super().event(event)
        self.directory.event(event)


TIMES = [each.to_bytes(3, "little") for each in (m.MAVLINK_MSG_ID_TIMESYNC, m.MAVLINK_MSG_ID_HOME_POSITION)]


class Obedient(Between):
    """Records COMMAND_LONGs and heartbeats to the vehicles; their answers that tell their time can be suppressed."""

    tells_time = True

    def __init__(self, fleet: Fleet) -> None:
        super().__init__(fleet)
        self.commands: list[CommandLong] = []
        self.heartbeats: dict[int, list[Instant]] = {}
        """By vehicle, when heartbeats arrived."""

    def take(self, datagram: Datagram, now: Instant) -> None:
        messages = [frame.message for frame in StreamParser().feed(datagram.data)]
        if any(isinstance(each, Heartbeat) for each in messages):
            self.heartbeats.setdefault(datagram.socket, []).append(now)
        self.commands += [each for each in messages if isinstance(each, CommandLong)]
        super().take(datagram, now)

    def datagrams_to_send(self) -> list[Datagram]:
        sent = super().datagrams_to_send()
        return [each for each in sent if self.tells_time or each.data[HEADER_V2 - 3 : HEADER_V2] not in TIMES]


class Killed:
    """A flight whose station is killed, and the station that takes over."""

    def __init__(self, directory: Path, **keys: Any) -> None:
        self.path = directory
        self.world = World(Obedient, recorder=lambda planned: Kept(planned, directory), **keys)

    def kill(self, seconds: float) -> None:
        """Kill the station; for some time there is none."""
        self.close()
        self.world.process.stop(self.world.clock.now(), 1e6)
        self.world.run(seconds)

    def close(self) -> None:
        """Leave the record as it is."""
        recorder = self.world.recorder
        assert isinstance(recorder, Kept)
        recorder.directory.close()

    def resume(self, *, take: bool = False) -> None:
        """Start another station on the record."""
        world, scenario = self.world, self.world.station.scenario
        assert epoch_us(self.path) == EPOCH_US
        resumed = read_past(self.path, scenario, world.clock.now(), take=take)
        world.recorder = Kept(scenario, self.path, resume=True)
        world.recorder.event(Event(resumed.at, RECORDING, GOES_ON, None, {"epoch_us": EPOCH_US}))
        world.station = Station(scenario, world.recorder, resumed=resumed)
        world.process.replace(world.station)
        assert isinstance(world.between, Obedient)
        world.between.commands.clear()
        world.between.heartbeats.clear()
        self.resumed_s = world.now_s

    def regained_s(self) -> float:
        """Return how long after the resumption every follower was in its slot to stay."""
        flown = [tick for tick in self.world.recorder.ticks if tick.phase in ("assembling", "flying")]
        followers = [column for column in range(len(self.world.fleet.vehicles)) if column != flown[0].leader]
        errors = [(tick.now / NANOSECONDS, np.abs([tick.error_m[each] for each in followers]).max()) for tick in flown]
        assert errors[-1][1] < SLOT_M
        last_s = max((at_s for at_s, error in errors if not error < SLOT_M), default=self.resumed_s)
        return last_s - self.resumed_s

    def commanded(self, command: int) -> list[CommandLong]:
        assert isinstance(self.world.between, Obedient)
        return [each for each in self.world.between.commands if each.command == command]


@pytest.fixture
def killed(tmp_path: Path) -> Generator[Callable[..., Killed]]:
    flights: list[Killed] = []

    def make(**keys: Any) -> Killed:
        flights.append(Killed(tmp_path / "run", **keys))
        return flights[-1]

    yield make
    for flight in flights:
        flight.close()


def test_what_flies_is_taken_over_and_no_vehicle_is_commanded_twice(killed: Callable[..., Killed]) -> None:
    """A bend begins while there is no station: they fly straight on, and the leader returns to the path from there."""
    path = {"speed_mps": 22, "waypoints_m": [[0, 0, 100], [200, 0, 100], [500, 200, 100], [700, 900, 100]]}
    flight = killed(duration_s=44, vehicles={"count": 2}, path=path, finish={"loiter_s": 0})
    world = flight.world
    world.fly_to(6.0)
    began = world.station.flight.path_began
    flight.kill(4.0)
    flight.resume()
    world.run()
    assert world.station.flight.phase is Phase.DONE
    assert world.station.flight.path_began == began
    assert world.times_s("takeover", text="taken over in GUIDED") == [pytest.approx(flight.resumed_s, abs=2.0)] * 2
    assert flight.regained_s() < 30.0
    assert flight.commanded(m.MAV_CMD_COMPONENT_ARM_DISARM) == []
    assert {command.param2 for command in flight.commanded(m.MAV_CMD_DO_SET_MODE)} == {m.PLANE_MODE_LOITER}
    steps_s = np.diff(Spool(flight.path / SPOOL).read()["t_s"])
    assert steps_s.min() >= 0.0
    assert 4.0 < steps_s.max() < 6.5
    events = [line.split('"kind": "')[1] for line in (flight.path / "events.jsonl").read_text().splitlines()]
    assert sum(event.startswith('phase", "text": "flying') for event in events) == 2


def test_each_gets_a_heartbeat_at_the_first_tick_after_it_is_heard_again(killed: Callable[..., Killed]) -> None:
    """Four ArduCopters' failsafe sent them home 0.9 s after they were taken over, before the first heartbeat."""
    flight = killed(duration_s=20, vehicles={"count": 3}, telemetry={"rate_hz": 5})
    world = flight.world
    world.fly_to(3.0)
    flight.kill(2.3)
    flight.resume()
    world.run(1.5)
    received_s = {number: world.times_s("link", number, text="connected")[-1] for number in (1, 2, 3)}
    assert isinstance(world.between, Obedient)
    assert {number: arrived[0] / NANOSECONDS for number, arrived in world.between.heartbeats.items()} == {
        number - 1: pytest.approx(at_s, abs=0.15) for number, at_s in received_s.items()
    }
    assert min(received_s.values()) >= flight.resumed_s


def test_a_machine_whose_clock_went_back_goes_on_from_the_records_end(
    killed: Callable[..., Killed], monkeypatch: pytest.MonkeyPatch
) -> None:
    """It has no battery for its clock, which is an hour behind after a power cut."""
    flight = killed(duration_s=44, vehicles={"count": 2})
    flight.world.fly_to(6.0)
    assert isinstance(flight.world.recorder, Kept)
    flight.world.recorder.directory.flush()
    planned, options = flight.world.station.scenario, RunOptions(flight.path, resume=True)
    recorded_s = max(float(Spool(flight.path / SPOOL).read()["t_s"][-1]), events_of(flight.path)[-1]["t_s"])

    monkeypatch.setattr(time, "time_ns", lambda: (EPOCH_US - 3600 * MICROSECONDS) * 1000)
    clock, resumed, behind_s = taken_up(planned, options)
    assert resumed.at / NANOSECONDS == pytest.approx(recorded_s + 1.0)
    assert resumed.path_began is not None
    assert clock.now() >= resumed.at > resumed.path_began
    assert behind_s == pytest.approx(3600.0 + recorded_s + 1.0, abs=60.0)

    monkeypatch.setattr(time, "time_ns", lambda: (EPOCH_US + 3600 * MICROSECONDS) * 1000)
    clock, resumed, behind_s = taken_up(planned, options)
    assert clock.now() >= resumed.at >= 3600 * NANOSECONDS
    assert behind_s == 0.0


@pytest.mark.slow
def test_shape_and_leader_are_those_of_the_record(killed: Callable[..., Killed]) -> None:
    """Shape and leader have changed by then; before a bend they fly straight on for 10 s."""
    changes = [{"at_s": 8, "shape": "line", "spacing_m": 25}, {"at_s": 20, "leader": 2}]
    flight = killed(duration_s=75, path=BENDS, formation={"shape": "arrow", "spacing_m": 30, "changes": changes})
    world = flight.world
    world.fly_to(31.0)
    flight.kill(10.0)
    flight.resume()
    world.run()
    assert {tick.leader for tick in world.recorder.ticks} == {1}
    assert world.words("formation")[-1] == "line, 25 m, behind vehicle 2"
    assert flight.regained_s() < REGAINED_S


def enter(world: World, number: int, mode: Mode) -> None:
    """Let a pilot or a failsafe set a mode."""
    world.vehicle(number).enter(mode)


@pytest.mark.slow
@pytest.mark.parametrize(
    ("mode", "take", "taken"), [(Mode.LOITER, False, False), (Mode.RTL, False, False), (Mode.LOITER, True, True)]
)
def test_one_that_was_given_another_mode_is_left_alone(
    killed: Callable[..., Killed], mode: Mode, take: bool, taken: bool
) -> None:
    flight = killed(duration_s=60)
    world = flight.world
    world.fly_to(5.0)
    flight.kill(3.0)
    enter(world, 2, mode)
    flight.resume(take=take)
    world.run(8.0)
    assert len(world.times_s("takeover", 2, "taken over" if taken else "left as it is")) == 1
    assert len(world.times_s("takeover", text="taken over")) == 2 + taken
    assert (world.vehicle(2).pilot.mode is Mode.GUIDED) == taken
    if not taken:
        world.station.phase_machine.stop(world.clock.now())
        world.run(12.0)
        assert world.vehicle(2).pilot.mode is mode
        assert world.vehicle(3).pilot.mode is Mode.LOITER


def test_where_none_flies_as_left_it_is_said_how_they_are_and_what_takes_them_and_none_is_commanded(
    killed: Callable[..., Killed],
) -> None:
    flight = killed(duration_s=60, vehicles={"count": 3})
    world = flight.world
    world.fly_to(2.0)
    flight.kill(3.0)
    for number, mode in ((1, Mode.RTL), (2, Mode.LOITER), (3, Mode.RTL)):
        enter(world, number, mode)
    flight.resume()
    world.run(20.0)
    assert world.station.flight.phase is Phase.FAILED
    assert world.station.phase_machine.failure == (
        "no vehicle to take over: vehicle 1, 3: in RTL, and the flight had left it in GUIDED; "
        "vehicle 2: in LOITER, and the flight had left it in GUIDED; --take takes those in the air"
    )
    (ended,) = [event for event in world.recorder.events if event.kind == "phase"]
    assert (ended.text, ended.details["cause"]) == ("failed", "the run can't go on, and no vehicle was commanded")
    assert flight.commanded(m.MAV_CMD_DO_SET_MODE) == []


def test_where_none_that_is_heard_gets_ready_none_is_waited_for_without_end(killed: Callable[..., Killed]) -> None:
    flight = killed(duration_s=60, vehicles={"count": 2})
    world = flight.world
    world.fly_to(2.0)
    flight.kill(3.0)
    assert isinstance(world.between, Obedient)
    world.between.tells_time = False
    flight.resume()
    world.run(40.0)
    assert len(world.times_s("abandoned")) == 2
    assert world.station.flight.phase is Phase.FAILED
    assert world.station.phase_machine.failure == "no vehicle to take over: none got ready"


@pytest.mark.slow
def test_where_the_leader_is_gone_the_nearest_to_its_place_leads(killed: Callable[..., Killed]) -> None:
    flight = killed(duration_s=90)
    world = flight.world
    world.fly_to(5.0)
    flight.kill(3.0)
    world.inject(1, "crash")
    flight.resume()
    world.run()
    (leads_s,) = world.times_s("leader", 2)
    assert leads_s - flight.resumed_s < 6.0
    assert world.times_s("leader", 3) == []
    late = [tick for tick in world.recorder.ticks if tick.mission_time_s > 60.0 and tick.phase == "flying"]
    assert max(np.nanmax(np.abs(tick.error_m[2])) for tick in late) < SLOT_M


@pytest.mark.slow
def test_killed_while_they_take_off_those_in_the_air_go_on_and_no_other_is_armed(
    killed: Callable[..., Killed],
) -> None:
    flight = killed(start={"in_air": False}, duration_s=20)
    world = flight.world
    world.network.run(lambda: world.vehicle(1).pilot.airborne and world.vehicle(2).pilot.airborne)
    vehicle = world.vehicle(3)
    vehicle.pilot.condition = Condition.DISARMED
    vehicle.body.ground()
    flight.kill(2.0)
    flight.resume()
    world.run(60.0)
    assert world.times_s("takeover", 3, "left as it is: on the ground")
    assert vehicle.pilot.condition is Condition.DISARMED
    assert flight.commanded(m.MAV_CMD_COMPONENT_ARM_DISARM) == []
    assert {world.vehicle(number).pilot.mode for number in (1, 2)} == {Mode.GUIDED}


@pytest.mark.slow
@pytest.mark.parametrize("opened_s", [0.2, 1.0, 4.0])
def test_killed_at_its_end_the_flight_is_brought_to_it(killed: Callable[..., Killed], opened_s: float) -> None:
    """They circle once each has reached a height of its own, as in any flight; they used to climb side by side."""
    flight = killed(duration_s=8)
    world = flight.world
    world.network.run(lambda: world.station.flight.phase is Phase.ENDING)
    world.run(opened_s)
    flight.kill(2.0)
    flight.resume()
    world.network.run(lambda: world.station.flight.phase is Phase.LOITERING)
    heights_m = sorted(body.state.height_m for body in world.fleet.bodies)
    assert np.diff(heights_m).min() > 10.0
    world.run(12.0)
    assert world.station.flight.phase is Phase.DONE
    assert {world.vehicle(number).pilot.mode for number in (1, 2, 3)} == {Mode.LOITER}
    assert flight.commanded(m.MAV_CMD_COMPONENT_ARM_DISARM) == []


def test_resumed_after_its_time_the_flight_ends_at_once(killed: Callable[..., Killed]) -> None:
    """It used to gather for 20 s, begin its path at 70 s of 60, and end in the same tick."""
    flight = killed(duration_s=8)
    world = flight.world
    world.fly_to(5.0)
    flight.kill(6.0)
    flight.resume()
    world.run(20.0)
    phases = [event for event in world.recorder.events if event.kind == "phase"]
    assert [each.text for each in phases[:2]] == ["assembling", "ending"]
    assert phases[1].details["cause"] == Cause.PATH_ENDED.value
    assert seconds_between(phases[0].now, phases[1].now) < 0.2


@pytest.mark.slow
@pytest.mark.parametrize("kind", ["udpin", "udpout"])
def test_killed_over_udp_and_resumed_the_formation_is_regained_within_60_s(kind: str, tmp_path: Path) -> None:
    """SIGKILL in flight; the vehicles are a process of their own. The record covers both stations.

    A station that sends to the vehicles first uses the same port again, because a PX4 answers no other.
    """
    path, out = tmp_path / "flight.yaml", tmp_path / "run"
    low = {"speed_mps": 22, "waypoints_m": [[0, 0, 50], [900, 0, 50], [1600, 500, 50], [6000, 2500, 50]]}
    ports = free_ports(3)
    vehicles = [{"id": i, "endpoint": f"{kind}:127.0.0.1:{port}"} for i, port in enumerate(ports, 1)]
    vehicles[0]["role"] = "leader"
    keys = scenario(start={"in_air": False}, duration_s=120, path=low, vehicles=vehicles)
    path.write_text(yaml.safe_dump(keys))
    with started([*VEHICLES, str(path), "--speedup", "2"]) as emulators:
        assert emulators.stdout is not None
        emulators.stdout.readline()
        with started([*STATION, "fly", str(path), "--speedup", "2", "--out", str(out)]) as station:
            wait_for_event(out, "flying")
            time.sleep(5.0)  # killed in flight, not at its beginning
            station.send_signal(signal.SIGKILL)
            station.wait(LIMIT_S)
        command = [*STATION, "fly", "--resume", str(out), "--speedup", "2", "--json"]
        done = subprocess.run(command, capture_output=True, text=True, timeout=2 * LIMIT_S, check=False)
    assert done.returncode == 0, done.stderr
    events = events_of(out)
    (resumed,) = [event for event in events if event["text"] == "goes on"]
    assert sum(event["text"] == "taken over in GUIDED" for event in events) == 3
    assert 0.0 < regained_s(out) - resumed["t_s"] < REGAINED_S
    armed_s = [(at_us - resumed["epoch_us"]) * 1e-6 for at_us in armings_us(out)]
    assert 0.0 < max(armed_s) < resumed["t_s"]
    sent_from = [event["port"] for event in events if event["kind"] == "port"]
    assert (len(sent_from), len(set(sent_from))) == ((6, 3) if kind == "udpout" else (0, 0))
    assert CliRunner().invoke(main, ["report", str(out)]).exit_code == 0


def regained_s(run: Path) -> float:
    """Return the time from which every follower had been in its slot for 5 s after the record's longest gap."""
    columns = read_parquet(run / "timeseries.parquet")
    errors = np.max([np.abs(columns[f"error_{axis}_m"]) for axis in "xyz"], axis=0)
    times_s = np.unique(columns["t_s"])
    gap = int(np.argmax(np.diff(times_s))) + 1
    off_s = [times_s[gap], *columns["t_s"][(columns["vehicle"] > 1) & ~(errors < 2 * SLOT_M)]]
    after = np.unique([np.inf, *(at_s for at_s in off_s if at_s >= times_s[gap])])
    settled = np.flatnonzero(np.diff(after) > 5.0)
    return float(after[settled[0]])


def armings_us(run: Path) -> list[int]:
    """Return when vehicles were commanded to arm, microseconds since 1970."""
    logged = read_tlog(run / "flight.tlog")
    frames = ((time_us, frame) for time_us, raw in logged for frame in StreamParser().feed(raw))
    sent = ((at_us, frame.message) for at_us, frame in frames if isinstance(frame.message, CommandLong))
    return [
        at_us for at_us, command in sent if command.command == m.MAV_CMD_COMPONENT_ARM_DISARM and command.param1 == 1.0
    ]


def test_what_can_not_be_resumed_is_refused_in_words(tmp_path: Path) -> None:
    for path, arguments, words in (
        (tmp_path, [], "found no run.yaml"),
        (tmp_path, ["configs/quickstart.yaml"], "SCENARIO: found beside --resume"),
        (tmp_path, ["--set", "seed=2"], "--set: found beside --resume"),
        (tmp_path, ["--dry-run"], "--dry-run: found beside --resume"),
    ):
        done = CliRunner().invoke(main, ["fly", "--resume", str(path), *arguments])
        assert (done.exit_code, words in done.stderr) == (2, True), done.stderr
    for arguments, words in (
        ([], "found no SCENARIO"),
        (["x.yaml", "--retake"], "x.yaml"),
        (["x.yaml", "--clock", "virtual"], "--clock: found virtual"),
        (["x.yaml", "--clock", "real"], "x.yaml"),
    ):
        done = CliRunner().invoke(main, ["fly", *arguments])
        assert (done.exit_code, words in done.stderr) == (2, True), done.stderr
