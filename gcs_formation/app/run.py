"""`gcs-formation run`: emulated vehicles and the ground station together, under either clock.

The only module of this package that imports `sim_vehicles`: it starts the vehicles and adds their ground truth to the
record.
"""

from __future__ import annotations

import os
import subprocess
import sys
from collections.abc import Generator
from contextlib import contextmanager
from functools import partial
from pathlib import Path

from airlink.cli import looking_seldom
from airlink.clock import Clock, Instant, RealClock, VirtualClock
from airlink.endpoint import PortError
from airlink.engine import MemoryNetwork
from airlink.udp import UdpDriver
from flight_model.arrays import Array
from formation_scenario import Scenario
from gcs_formation.app.operator import Interrupts, RunOptions
from gcs_formation.app.progress import Progress
from gcs_formation.app.session import Session
from gcs_formation.errors import RunAbortedError
from gcs_formation.record.run_directory import SCENARIO, TRUTH
from gcs_formation.record.summary import Summary
from gcs_formation.recorder import Event
from sim_vehicles.config import fleet_config, stand_ins
from sim_vehicles.fleet import Fleet
from sim_vehicles.truth import TruthError, TruthWriter, read_truth

END_S = 5.0
"""Wall time that the emulators get to end by themselves, s."""


def run(scenario: Scenario, options: RunOptions, progress: Progress, interrupts: Interrupts) -> Summary:
    """Fly a scenario with emulated vehicles.

    Raises:
        RunAbortedError: a port is taken, a vehicle refused, the emulators ended.
        RecordError: the run directory can't be written.
    """
    flown = _run_virtual if options.clock == "virtual" else _run_real
    with looking_seldom():
        return flown(scenario, options, progress, interrupts)


def _run_virtual(scenario: Scenario, options: RunOptions, progress: Progress, interrupts: Interrupts) -> Summary:
    """Fly in one process, as fast as it goes: the same engines on a network in memory."""
    clock = VirtualClock()
    session = _open(scenario, options, clock, progress, interrupts)
    network = MemoryNetwork(clock)
    with TruthWriter(options.out / TRUTH, len(scenario.vehicles)) as writer:
        fleet = Fleet(fleet_config(scenario), truth=writer)
        try:
            network.attach(fleet)
            network.attach(session.engine)
        except PortError as error:
            raise RunAbortedError(str(error)) from error
        network.run(session.attend)
    return _conclude(session)


def _run_real(scenario: Scenario, options: RunOptions, progress: Progress, interrupts: Interrupts) -> Summary:
    """Fly over UDP, the vehicles in a process of their own."""
    clock = RealClock(options.speedup)
    session = _open(scenario, options, clock, progress, interrupts)
    try:
        with UdpDriver(session.engine, clock) as driver, _emulators(options, clock) as emulators, session.listening():
            driver.run(partial(_over, session, emulators))
    except PortError as error:
        session.recorder.close()
        raise RunAbortedError(str(error)) from error
    return _conclude(session)


def _open(scenario: Scenario, options: RunOptions, clock: Clock, progress: Progress, interrupts: Interrupts) -> Session:
    """Return a session with emulated vehicles, that says which of them stand for real ones."""
    session = Session(scenario, options, clock, progress, interrupts, emulated=True)
    text = stand_ins(scenario)
    if text:
        session.recorder.event(Event(Instant(0), "emulation", text))
    return session


@contextmanager
def _emulators(options: RunOptions, clock: RealClock) -> Generator[subprocess.Popen[bytes]]:
    """Have the emulated vehicles in a process of their own; it ends when this process does, in whatever way."""
    command = [sys.executable, "-m", "sim_vehicles", str(options.out / SCENARIO)]
    command += ["--speedup", str(options.speedup), "--clock-origin", str(clock.origin_ns)]
    command += ["--truth", str(options.out / TRUTH)]
    command += ["--with-parent", str(os.getpid()), "--quiet"]
    # A session of its own, so that Ctrl-C only reaches us and we can tell the vehicles to loiter first.
    process = subprocess.Popen(command, stdin=subprocess.PIPE, stderr=subprocess.PIPE, start_new_session=True)
    try:
        yield process
    finally:
        process.terminate()
        try:
            process.communicate(timeout=END_S)
        except subprocess.TimeoutExpired:
            process.kill()
            process.communicate()


def _over(session: Session, emulators: subprocess.Popen[bytes]) -> bool:
    """Attend to a flight, which fails if its vehicles' process has ended; return whether it is over."""
    course = session.station.course
    if course.failure is None and emulators.poll() is not None and not session.station.flight.ended:
        said = emulators.stderr.read().decode(errors="replace").strip() if emulators.stderr else ""
        said = said or f"exit status {emulators.returncode}"
        course.fail(f"the emulated vehicles' process has ended: {said}", session.clock.now())
    return session.attend()


def _conclude(session: Session) -> Summary:
    """Return the summary; without one, the ground truth stays in the directory for `report`."""
    summary = session.conclude(recorded_truth(session.options.out))
    (session.options.out / TRUTH).unlink(missing_ok=True)
    return summary


def recorded_truth(directory: Path) -> dict[str, Array] | None:
    """Return the emulators' ground truth as far as it was written, None if they wrote none."""
    try:
        rows = read_truth(directory / TRUTH)
    except (FileNotFoundError, TruthError):  # interrupted before the emulators began to write it
        return None
    return rows if len(rows["time_s"]) >= 2 else None
