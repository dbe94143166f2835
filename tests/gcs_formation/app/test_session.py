"""What a session knows about the links depends on whose vehicles it flies."""

from __future__ import annotations

import json
import os
import subprocess
from contextlib import nullcontext
from functools import partial
from pathlib import Path

import jsonschema
import numpy as np
import pytest

from airlink.clock import Instant, VirtualClock, after
from airlink.engine import MemoryNetwork
from formation_scenario import Scenario, load_scenario
from gcs_formation.app.fly import clock_behind, resolve_peers
from gcs_formation.app.operator_at_terminal import Interrupts
from gcs_formation.app.progress import Progress
from gcs_formation.app.result_text import summary_text
from gcs_formation.app.run import in_memory, over
from gcs_formation.app.run_options import RunOptions
from gcs_formation.app.session import Session
from gcs_formation.errors import RecordError, RunAbortedError
from gcs_formation.identify import identify
from gcs_formation.phases import Phase
from gcs_formation.record.parquet import read_parquet
from gcs_formation.record.run_directory import TIMESERIES
from gcs_formation.record.summary import Summary
from gcs_formation.record.unfinished import recorded_events
from gcs_formation.report import load_run
from gcs_formation.testing.flown_flight import FlownFlight
from sim_vehicles.config import fleet_config
from sim_vehicles.fleet import Fleet
from tests.flights.conftest import scenario
from tests.processes import wait_for

DOCS = Path(__file__).parents[3] / "docs"


@pytest.mark.parametrize(("emulated", "delay"), [(True, 0.0), (False, None)])
def test_where_nothing_is_injected_here_the_delay_of_others_links_is_unknown(
    emulated: bool, delay: float | None, tmp_path: Path
) -> None:
    """On links that the scenario doesn't impair: 0 with our own emulators, unknown otherwise."""
    planned, clock = load_scenario(scenario(duration_s=1, vehicles={"count": 2})), VirtualClock()
    options = RunOptions(tmp_path, "virtual")
    session = Session(planned, options, clock, Progress(), Interrupts(), emulated=emulated)
    network = MemoryNetwork(clock)
    network.attach(Fleet(fleet_config(planned)))
    network.attach(session.engine)
    network.run(session.attend)
    link = session.conclude(None).to_dict()["links"]["2"]
    assert (link["injected_delay_ms"], link["injected_loss"], link["injected_loss_up"]) == (delay, delay, delay)
    injected_s = read_parquet(tmp_path / TIMESERIES)["injected_delay_s"]
    assert np.isnan(injected_s).all() if delay is None else not injected_s.any()


def test_a_run_that_raises_leaves_no_file_of_its_record_open(tmp_path: Path) -> None:
    planned = load_scenario(scenario(duration_s=1, vehicles={"count": 2}))

    def opened() -> list[str]:
        links = [each for each in Path("/proc/self/fd").iterdir() if each.is_symlink()]
        return [str(each.readlink()) for each in links if str(each.readlink()).startswith(str(tmp_path))]

    def flown(session: Session) -> None:
        assert opened()
        raise ZeroDivisionError(str(session.clock.now()))

    with (
        pytest.raises(ZeroDivisionError) as raised,
        in_memory(planned, RunOptions(tmp_path, "virtual"), Progress(), Interrupts()) as (session, _),
    ):
        flown(session)
    assert opened() == []
    assert str(raised.value) == "0"


def test_a_vehicle_that_is_sent_to_by_name_is_known_by_the_number_that_it_answers_from(tmp_path: Path) -> None:
    planned = load_scenario(
        scenario(duration_s=1, vehicles={"count": 2, "autopilot": "arduplane", "endpoint": "udpout:localhost:9"})
    )
    session = Session(planned, RunOptions(tmp_path), VirtualClock(), Progress(), Interrupts(), emulated=False)
    resolve_peers(session)
    session.recorder.close()
    peers = {str(vehicle.connection.peer) for vehicle in session.station.vehicles.values()}
    assert peers == {"127.0.0.1:9"}


@pytest.mark.parametrize(
    ("speedup", "words"), [(5.0, r"in 30 s$"), (200.0, r"in 30 s \(with --speedup 200, which .*\)$")]
)
def test_where_none_was_heard_none_was_commanded_to_loiter_and_haste_is_named(
    speedup: float, words: str, tmp_path: Path
) -> None:
    planned, clock = load_scenario(scenario(duration_s=1, vehicles={"count": 2})), VirtualClock()
    options = RunOptions(tmp_path, speedup=speedup)
    session = Session(planned, options, clock, Progress(), Interrupts(), emulated=True)
    network = MemoryNetwork(clock)
    network.attach(session.engine)
    network.run(session.attend)
    with pytest.raises(RunAbortedError, match=words):
        session.conclude(None)
    assert "no vehicle was commanded" in (tmp_path / "events.jsonl").read_text()
    assert "loiter" not in (tmp_path / "events.jsonl").read_text()


@pytest.mark.parametrize(
    ("fails_in", "emulated", "summed_up"),
    [(Phase.LOITERING, False, True), (Phase.FLYING, True, True), (Phase.FLYING, False, False)],
)
def test_what_was_flown_before_it_failed_is_in_the_summary(
    fails_in: Phase, emulated: bool, summed_up: bool, tmp_path: Path
) -> None:
    """But `fly` makes none of a flight that fails on its way, because it may be resumed."""
    planned, clock = load_scenario(scenario(duration_s=1, vehicles={"count": 2})), VirtualClock()
    session = Session(planned, RunOptions(tmp_path, "virtual"), clock, Progress(), Interrupts(), emulated=emulated)

    def attend() -> bool:
        if session.station.flight.phase is fails_in:
            session.station.phase_machine.fail("it can't go on", clock.now())
        return session.attend()

    network = MemoryNetwork(clock)
    network.attach(Fleet(fleet_config(planned)))
    network.attach(session.engine)
    network.run(attend)
    with pytest.raises(RunAbortedError, match="it can't go on"):
        session.conclude(None)
    kept = tmp_path / "summary.json"
    assert kept.is_file() is (tmp_path / TIMESERIES).is_file() is summed_up
    assert not summed_up or json.loads(kept.read_text())["failure"] == "it can't go on"


@pytest.mark.parametrize(
    ("answers", "rehearse", "replaced"), [(False, False, False), (True, True, False), (True, False, True)]
)
def test_an_earlier_runs_record_is_replaced_once_somebody_is_commanded(
    answers: bool, rehearse: bool, replaced: bool, tmp_path: Path
) -> None:
    planned = load_scenario(scenario(duration_s=1, vehicles={"count": 2}))
    session_of(planned, RunOptions(tmp_path, "virtual")).conclude(None)
    earlier = {name: (tmp_path / name).read_bytes() for name in ("flight.tlog", "events.jsonl", "summary.json")}
    options = RunOptions(tmp_path, "virtual", overwrite=True, dry_run=rehearse)
    session = session_of(planned, options, answers=answers)
    session.recorder.close()
    assert session.recorder.path == (tmp_path if replaced else tmp_path / "unflown")
    kept = {name: (tmp_path / name).read_bytes() for name in earlier if (tmp_path / name).is_file()}
    assert kept == earlier or replaced
    assert (tmp_path / "summary.json").exists() != replaced
    phases = [event for event in recorded_events(session.recorder.path)[0] if event["kind"] == "phase"]
    assert len(phases) == 1 or replaced


def session_of(planned: Scenario, options: RunOptions, *, answers: bool = True) -> Session:
    """Return the session of a flight of emulated vehicles, which answer or don't exist, at its end."""
    clock = VirtualClock()
    session = Session(planned, options, clock, Progress(), Interrupts(), emulated=True)
    network = MemoryNetwork(clock)
    if answers:
        network.attach(Fleet(fleet_config(planned)))
    network.attach(session.engine)
    network.run(session.attend)
    return session


def test_vehicles_are_waited_for_from_when_their_process_says_that_it_is_up(tmp_path: Path) -> None:
    planned, clock = load_scenario(scenario(duration_s=1, vehicles={"count": 2})), VirtualClock()
    session = Session(planned, RunOptions(tmp_path), clock, Progress(), Interrupts(), emulated=True)
    with subprocess.Popen(["cat"], stdin=subprocess.PIPE, stdout=subprocess.PIPE) as emulators:
        assert emulators.stdin is not None
        assert emulators.stdout is not None
        os.set_blocking(emulators.stdout.fileno(), False)
        clock.move_to(after(Instant(0), 100.0))
        assert not over(session, emulators)
        assert session.station.flight.since == clock.now()
        emulators.stdin.write(b"ready\n")
        emulators.stdin.flush()
        wait_for(lambda: over(session, emulators) or emulators.stdout is None)
        clock.move_to(after(Instant(0), 120.0))
        over(session, emulators)
        assert session.station.flight.since == after(Instant(0), 100.0)
    session.recorder.close()


@pytest.mark.parametrize(
    ("began", "goes_on", "said"),
    [(25.0, 1.0, "; the run began with --speedup 25, and goes on with 1"), (25.0, 25.0, ""), (1.0, 1.0, "")],
)
def test_a_record_that_is_ahead_by_its_speedup_says_so(began: float, goes_on: float, said: str, tmp_path: Path) -> None:
    planned = load_scenario(scenario(duration_s=1, vehicles={"count": 2}))
    options = RunOptions(tmp_path, speedup=began)
    Session(planned, options, VirtualClock(), Progress(), Interrupts(), emulated=True).recorder.close()
    assert clock_behind(RunOptions(tmp_path, speedup=goes_on, resume=True), 22.0) == (
        f"the machine's clock is 22 s behind the record: time goes on from the record's end{said}"
    )


WAYS_TO_END = ("interrupt", "interrupted three times", "loiter", "rtl", "land", "failure")


def stopped(directory: Path, way: str, at_s: float, *, answers: bool) -> Session:
    """Return the session of a flight from the ground that is stopped some time after it began to connect."""
    expect = [{"metric": "error_x_m.max", "below": 1}, {"metric": "measured_delay_ms.p99", "below": 1}]
    expect += [{"metric": "min_separation_m", "above": 1}, {"metric": "violations", "below": 1}]
    keys = scenario(duration_s=1, vehicles={"count": 2}, start={"in_air": False}, expect=expect)
    clock, interrupts, planned = VirtualClock(), Interrupts(), load_scenario(keys)
    session = Session(planned, RunOptions(directory, "virtual"), clock, Progress(), interrupts, emulated=True)
    network, due = MemoryNetwork(clock), [at_s]

    def attend() -> bool:
        if due and clock.now() >= after(Instant(0), due[0]):
            due.clear()
            if way.startswith("interrupt"):
                interrupts.count += 1 if way == "interrupt" else 3
            elif way == "failure":
                session.station.phase_machine.fail("it can't go on", clock.now())
            else:
                assert session.station.orders.execute(way, clock.now()).accepted
        return session.attend()

    if answers:
        network.attach(Fleet(fleet_config(planned)))
    network.attach(session.engine)
    network.run(attend)
    return session


@pytest.mark.parametrize("way", WAYS_TO_END)
@pytest.mark.parametrize(("at_s", "answers"), [(0.0, True), (1.0, False), (2.0, True)])
def test_a_run_that_is_stopped_before_any_flies_leaves_a_whole_record(
    way: str, at_s: float, answers: bool, tmp_path: Path
) -> None:
    """Its time series has no rows, and nothing of it is judged; who reads it is told that nothing was flown."""
    session = stopped(tmp_path / "run", way, at_s, answers=answers)
    with pytest.raises(RunAbortedError, match="it can't go on") if way == "failure" else nullcontext():
        summary = session.conclude(None)
        assert summary.held is None
        assert {verdict.held for verdict in summary.verdicts} == {None}
        assert "didn't reach its path" in summary_text(summary, tmp_path)
    found = json.loads((tmp_path / "run" / "summary.json").read_text())
    jsonschema.validate(found, json.loads((DOCS / "summary.schema.json").read_text()))
    assert found["duration_s"] == 0.0
    assert found["failure"] == ("it can't go on" if way == "failure" else None)
    assert read_parquet(tmp_path / "run" / TIMESERIES)["t_s"].size == 0
    with pytest.raises(RecordError, match="nothing was flown"):
        load_run(tmp_path / "run")
    with pytest.raises(RecordError):
        identify(tmp_path / "run", tmp_path / "vehicle.yaml", None, None)
    claims = FlownFlight(session.scenario, Summary(found, (), ()), tmp_path / "run", "again")
    for claim in (claims.meets_its_expectations, partial(claims.keeps_apart, 1), partial(claims.stays_within, 1)):
        with pytest.raises(AssertionError):
            claim()


def test_a_run_that_is_stopped_after_take_off_before_its_path_has_a_summary(tmp_path: Path) -> None:
    """Its vehicles fly on at the end: whether their links were out by then isn't known by mission time."""
    session = stopped(tmp_path, "interrupted three times", 16.0, answers=True)
    assert session.station.recorded_ticks > 0
    assert session.conclude(None).held is None
    assert not load_run(tmp_path).begun
