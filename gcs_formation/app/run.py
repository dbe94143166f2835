"""`gcs-formation run` and `fly`: the ground station with emulated vehicles, alone, or in a dry run.

`run` starts the emulated vehicles and adds their ground truth to the record.
"""

from __future__ import annotations

import json
import os
import subprocess
import sys
from collections.abc import Callable, Generator
from contextlib import closing, contextmanager, suppress
from functools import partial
from importlib import import_module
from pathlib import Path
from typing import IO

from airlink.cli import rare_garbage_collection, same_modules
from airlink.clock import Clock, Instant, RealClock, VirtualClock
from airlink.driver import Driver
from airlink.endpoint import Address, ComponentId, PortError, VehicleId
from airlink.engine import Engine, MemoryNetwork
from airlink.forwarding import Forward, Forwarding, Remote
from airlink.signing.signed_links import VerifyingReceiver
from airlink.transports.udp import resolved
from formation_scenario import Scenario
from formation_scenario.extensions import LINK, ExtensionError
from formation_scenario.fields import refused
from formation_scenario.scripted import ScriptedOrder
from formation_scenario.simulated import Place
from gcs_formation.app.link_processes import UNKNOWN
from gcs_formation.app.operator_at_terminal import Interrupts
from gcs_formation.app.progress import Progress
from gcs_formation.app.run_options import RunOptions
from gcs_formation.app.session import Session
from gcs_formation.record.run_directory import SCENARIO, SUMMARY, TRUTH
from gcs_formation.record.summary import Summary
from gcs_formation.recorder import Detail, Event
from sim_vehicles.config import fleet_config, stand_ins
from sim_vehicles.fleet import Fleet
from sim_vehicles.truth import TruthError, TruthRecord, TruthWriter

IMPORTED_AHEAD = ("airlink.installed", "importlib.metadata", "scipy.optimize", "scipy.sparse.csgraph", "scipy.spatial")
"""Only some flights need these, but a tick that first has to import them would be late by a second."""
END_S = 5.0
"""Wall time that the emulators get to exit by themselves, s."""


def run(scenario: Scenario, options: RunOptions, progress: Progress, interrupts: Interrupts) -> Summary:
    """Fly a scenario with emulated vehicles.

    Raises:
        RunAbortedError: a port is taken, a vehicle refused, the emulators ended.
        RecordError: the run directory can't be written.
        ScenarioError: it is the record of a flight of which a program replaced setpoints.
    """
    require_no_program(scenario)
    flown = _run_virtual if options.clock == "virtual" else _run_real
    with rare_garbage_collection():
        return flown(scenario, options, progress, interrupts)


def require_no_program(scenario: Scenario) -> None:
    """Refuse the record of a flight of which a program replaced setpoints: without it, another flight would be flown.

    Raises:
        ScenarioError: it is one.
    """
    for index, act in scenario.scripted:
        if act.setpoints is not None:
            found = f"found '{act.setpoints}' after tick {act.at_tick}"
            raise refused(f"orders.{index}.setpoints", found, "with that program, by gcs_formation.Flight")


Run = Callable[[Callable[[], bool]], None]
"""Runs a flight until a function, called after every event, returns True; it goes on with the next call."""


def _run_virtual(scenario: Scenario, options: RunOptions, progress: Progress, interrupts: Interrupts) -> Summary:
    with in_memory(scenario, options, progress, interrupts) as (session, run_until):
        run_until(session.attend)
    return conclude(session)


@contextmanager
def in_memory(
    scenario: Scenario, options: RunOptions, progress: Progress, interrupts: Interrupts
) -> Generator[tuple[Session, Run]]:
    """Yield a flight in one process, as fast as the processor allows: the same engines on an in-memory network.

    Raises:
        RunAbortedError: two vehicles have the same address.
        RecordError: the run directory can't be written.
    """
    clock = VirtualClock()
    session = _open(scenario, options, clock, progress, interrupts)
    network = MemoryNetwork(clock)
    with TruthWriter(session.recorder.path / TRUTH, len(scenario.vehicles)) as writer:
        try:
            fleet = Fleet(fleet_config(scenario), truth=writer)
        except ExtensionError as error:
            raise session.could_not_begin(error) from error
        if scenario.registered:
            session.emulators_failure = lambda: fleet.failure
            session.link_processes.positions = partial(_true_position, fleet)

        def strike(act: ScriptedOrder, hit: frozenset[VehicleId], zero: Instant) -> None:
            if act.fault is not None:
                fleet.environment.strike(act.fault, hit, zero)
            if act.disturbance is not None:
                fleet.environment.disturb(act.disturbance, hit, zero)

        session.script.emulators, session.replace = strike, partial(network.replace, session.engine)
        try:
            network.attach(fleet)
            network.attach(session.engine)
        except PortError as error:
            raise session.could_not_begin(error) from error
        with closed_if_it_raises(session):
            yield session, network.run


@contextmanager
def closed_if_it_raises(session: Session) -> Generator[None]:
    """Close the record of a flight that raises: it isn't concluded, and its files would stay open."""
    flown = False
    try:
        yield
        flown = True
    finally:
        if not flown:
            session.recorder.close()


def _true_position(fleet: Fleet, vehicle: VehicleId) -> Place:
    state = fleet.bodies[fleet.index_of(vehicle)].state
    return Place(state.north_m, state.east_m, state.height_m)


def _run_real(scenario: Scenario, options: RunOptions, progress: Progress, interrupts: Interrupts) -> Summary:
    with over_udp(scenario, options, progress, interrupts) as (session, run_until, is_over):
        run_until(is_over)
    return conclude(session)


@contextmanager
def over_udp(
    scenario: Scenario, options: RunOptions, progress: Progress, interrupts: Interrupts
) -> Generator[tuple[Session, Run, Callable[[], bool]]]:
    """Yield a flight over UDP, the vehicles in a process of their own, and what tells whether it is over.

    Raises:
        RunAbortedError: a port is taken.
        RecordError: the run directory can't be written.
    """
    import_ahead()
    clock = RealClock(options.speedup)
    session = _open(scenario, options, clock, progress, interrupts)
    try:
        engine, replaced = forwarded(session)
        with (
            closing(_ProcessOutput()) as process_output,
            Driver(engine, clock) as driver,
            _emulators(session, clock) as emulators,
            session.listening(),
        ):
            session.script.emulators, session.replace = partial(_strike, emulators), replaced or driver.replace
            if scenario.registered:
                session.emulators_failure = process_output.failure
                session.link_processes.positions = partial(_recorded_position, session)
            with closed_if_it_raises(session):
                yield session, driver.run, partial(over, session, emulators, process_output)
    except PortError as error:
        raise session.could_not_begin(error) from error


def forwarded(session: Session) -> tuple[Engine, Callable[[Engine], None] | None]:
    """Return a session's engine with its second ground stations, and what replaces the engine beneath them."""
    forwards, station = session.options.forward, session.station
    if not forwards:
        return session.engine, None
    ends = tuple(Forward(resolved(each.endpoint), each.takes) for each in forwards)

    def joined(sender: ComponentId, peer: Address, now: Instant) -> None:
        details: dict[str, Detail] = {"peer": str(peer)}
        session.recorder.event(Event(now, "forward", f"a second ground station, {sender}, is heard", None, details))

    def remotes() -> list[Remote]:
        links = [(each.identity.system, each.connection) for each in station.vehicles.values()]
        return [Remote(system, link.socket, link.peer) for system, link in links if link.peer is not None]

    ids, signing = station.scenario.station.ids, session.signing.links
    if signing is None:
        engine = Forwarding(session.engine, ends, remotes, ids, joined)
    else:
        engine = Forwarding(session.engine, ends, remotes, ids, joined, VerifyingReceiver(signing.copied()).passed)
    station.cycle.findings.others_listen = True
    return engine, engine.replace


def _strike(emulators: subprocess.Popen[bytes], act: ScriptedOrder, hit: frozenset[VehicleId], zero: Instant) -> None:
    """Send a fault or a disturbance to the emulators' process, as a line of JSON."""
    struck = act.fault or act.disturbance
    if struck is not None and emulators.stdin is not None:
        keys = struck.model_dump(exclude={"vehicles"}, exclude_none=True)
        line = {"zero": zero, "vehicles": sorted(hit), "fault" if act.fault else "disturbance": keys}
        with suppress(BrokenPipeError):  # they have ended, which `over` notices
            emulators.stdin.write(json.dumps(line).encode() + b"\n")
            emulators.stdin.flush()


def import_ahead() -> None:
    """Import what a flight under the real clock may need, before it begins."""
    for module in IMPORTED_AHEAD:
        import_module(module)


def _open(scenario: Scenario, options: RunOptions, clock: Clock, progress: Progress, interrupts: Interrupts) -> Session:
    """Return a session with emulated vehicles; an event says which of them stand in for real autopilots."""
    session = Session(scenario, options, clock, progress, interrupts, emulated=True)
    session.lying = partial(lying, session)
    text = stand_ins(scenario)
    if text:
        session.recorder.event(Event(Instant(0), "emulation", text))
    return session


@contextmanager
def _emulators(session: Session, clock: RealClock) -> Generator[subprocess.Popen[bytes]]:
    """Run the emulated vehicles in a process of their own, which ends with this one in any case."""
    directory = session.recorder.path
    command = [sys.executable, "-m", "sim_vehicles", str(directory / SCENARIO)]
    command += ["--speedup", str(session.options.speedup), "--clock-origin", str(clock.origin_ns)]
    command += ["--truth", str(directory / TRUTH)]
    command += ["--truth-at-once"] if session.scenario.registered.of(LINK) else []
    command += [word for file in session.scenario.registered.files for word in ("--plugin", file)]
    command += ["--with-parent", str(os.getpid()), "--quiet"]
    # A session of its own: Ctrl-C reaches only us, so that we can tell the vehicles to loiter first.
    pipe, environment = subprocess.PIPE, os.environ | same_modules()
    process = subprocess.Popen(command, stdin=pipe, stdout=pipe, stderr=pipe, env=environment, start_new_session=True)
    if process.stdout is not None:
        os.set_blocking(process.stdout.fileno(), False)
    try:
        yield process
    finally:
        process.terminate()
        try:
            process.communicate(timeout=END_S)
        except subprocess.TimeoutExpired:
            process.kill()
            process.communicate()


class _ProcessOutput:
    """What the emulators' process says on its standard output after it is up: what failed of its extensions."""

    def __init__(self) -> None:
        self.output: IO[bytes] | None = None
        self._text = b""

    def failure(self) -> str | None:
        """Return what failed, if anything."""
        if self.output is not None:
            self._text += self.output.read() or b""
        line, ended, _ = self._text.partition(b"\n")[2].partition(b"\n")
        return line.decode(errors="replace") if ended else None

    def close(self) -> None:
        """Read no more."""
        if self.output is not None:
            self.output.close()


def _recorded_position(session: Session, vehicle: VehicleId) -> Place:
    """Return where a vehicle is by the newest ground truth that its emulator has written."""
    truth = recorded_truth(session.recorder.path)
    columns = [each.vehicle_id for each in session.scenario.vehicles]
    return UNKNOWN if truth is None else Place(*truth.position_of(columns.index(vehicle)))


def over(session: Session, emulators: subprocess.Popen[bytes], process_output: _ProcessOutput | None = None) -> bool:
    """Attend to a flight, which fails if its emulators' process has ended; return whether it is over.

    `process_output` takes the process's output, if extensions may fail in it.
    """
    phase_machine = session.station.phase_machine
    if emulators.stdout is not None:
        session.begin_to_wait()
        if emulators.stdout.read(1) is not None:  # the emulators are up, or have exited
            if process_output is None or session.emulators_failure is None:
                emulators.stdout.close()
            else:
                process_output.output = emulators.stdout
            emulators.stdout = None
    if phase_machine.failure is None and emulators.poll() is not None and not session.station.flight.ended:
        last = emulators.stderr.read().decode(errors="replace").strip() if emulators.stderr else ""
        last = last or f"exit status {emulators.returncode}"
        phase_machine.fail(f"the emulated vehicles' process has ended: {last}", session.clock.now())
    return session.attend()


def conclude(session: Session) -> Summary:
    """Return the summary. If there is none, the ground truth stays in the directory for `report`."""
    directory = session.recorder.path
    truth = recorded_truth(directory)
    try:
        return session.conclude(None if truth is None else truth.between)
    finally:
        if (directory / SUMMARY).is_file():
            (directory / TRUTH).unlink(missing_ok=True)


def recorded_truth(directory: Path) -> TruthRecord | None:
    """Return the emulators' ground truth as far as it was written; None if they wrote none."""
    try:
        record = TruthRecord(directory / TRUTH)
    except (FileNotFoundError, TruthError):  # interrupted before the emulators began to write it
        return None
    return record if record.rows >= 2 else None


def lying(session: Session) -> set[VehicleId]:
    """Return the vehicles that are on the ground by the newest ground truth; none if there is none yet."""
    truth = recorded_truth(session.recorder.path)
    if truth is None:
        return set()
    airborne = truth.between(truth.last_s, truth.last_s)["airborne"][-1]
    return {each.vehicle_id for each, aloft in zip(session.scenario.vehicles, airborne, strict=True) if not aloft}
