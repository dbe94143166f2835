"""`gcs-formation run`: emulated vehicles and the ground station together, under either clock.

The only module of this package that imports `sim_vehicles`: it starts the vehicles and adds their ground truth to the
record.
"""

from __future__ import annotations

import os
import subprocess
import sys
from collections.abc import Callable
from pathlib import Path

from airlink.cli.commands import looking_seldom
from airlink.clock import Clock, Instant, RealClock, VirtualClock
from airlink.endpoint import PortError
from airlink.engine import MemoryNetwork
from airlink.udp import UdpDriver
from formation_scenario import Scenario
from gcs_formation.app.operator import Interrupts, RunOptions
from gcs_formation.app.progress import Progress
from gcs_formation.app.session import Session
from gcs_formation.errors import RunAbortedError
from gcs_formation.record.run_directory import SCENARIO, TRUTH
from gcs_formation.record.summary import Summary
from gcs_formation.record.timeseries import GroundTruth
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
        with UdpDriver(session.engine, clock) as driver, _Emulators(options, clock) as emulators, session.listening():
            driver.run(_watch(session, emulators))
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


class _Emulators:
    """The emulated vehicles' process; it ends when this process does, in whatever way."""

    def __init__(self, options: RunOptions, clock: RealClock) -> None:
        command = [sys.executable, "-m", "sim_vehicles", str(options.out / SCENARIO)]
        command += ["--speedup", str(options.speedup), "--clock-origin", str(clock.origin_ns)]
        command += ["--truth", str(options.out / TRUTH)]
        command += ["--with-parent", str(os.getpid()), "--quiet"]
        self._command = command

    def __enter__(self) -> _Emulators:
        # A session of its own, so that Ctrl-C only reaches us and we can tell the vehicles to loiter first.
        self._process = subprocess.Popen(
            self._command, stdin=subprocess.PIPE, stderr=subprocess.PIPE, start_new_session=True
        )
        return self

    def __exit__(self, *_: object) -> None:
        self._process.terminate()
        try:
            self._process.communicate(timeout=END_S)
        except subprocess.TimeoutExpired:
            self._process.kill()
            self._process.communicate()

    def ended(self) -> str | None:
        """Return what the process said if it has ended, None while it runs."""
        if self._process.poll() is None:
            return None
        said = self._process.stderr.read().decode(errors="replace").strip() if self._process.stderr else ""
        return said or f"exit status {self._process.returncode}"


def _watch(session: Session, emulators: _Emulators) -> Callable[[], bool]:
    station = session.station

    def over() -> bool:
        said = emulators.ended() if station.course.failure is None else None
        if said is not None and not station.flight.ended:
            station.course.fail(f"the emulated vehicles' process has ended: {said}", session.clock.now())
        return session.attend()

    return over


def _conclude(session: Session) -> Summary:
    """Return the summary; without one, the ground truth stays in the directory for `report`."""
    summary = session.conclude(recorded_truth(session.options.out, session.scenario))
    (session.options.out / TRUTH).unlink(missing_ok=True)
    return summary


def recorded_truth(directory: Path, scenario: Scenario) -> GroundTruth | None:
    """Return the emulators' ground truth as far as it was written, None if they wrote none."""
    try:
        rows = read_truth(directory / TRUTH)
    except (FileNotFoundError, TruthError):  # interrupted before the emulators began to write it
        return None
    if len(rows["time_s"]) < 2:
        return None
    return GroundTruth(tuple(vehicle.vehicle_id for vehicle in scenario.vehicles), rows)
