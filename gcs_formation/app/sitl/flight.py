"""`gcs-formation run --sitl`: a flight with the user's simulators, started and ended with it."""

from __future__ import annotations

import time
from collections.abc import Mapping, Sequence
from functools import partial
from pathlib import Path

from airlink.clock import RealClock
from airlink.driver import Driver
from airlink.endpoint import PortError, VehicleId
from formation_scenario import Scenario
from gcs_formation.app.fly import resolve_peers
from gcs_formation.app.operator_at_terminal import Interrupts
from gcs_formation.app.progress import Progress
from gcs_formation.app.run import forwarded, import_ahead, require_no_program
from gcs_formation.app.run_options import RunOptions
from gcs_formation.app.session import Session
from gcs_formation.app.sitl.fleet import Simulated, not_simulated, simulated
from gcs_formation.app.sitl.processes import Running, ended, running, with_free_ports
from gcs_formation.app.sitl.simulator import SimulatorError, TrueMotion
from gcs_formation.app.sitl.truth import Clocks, LoggedTruth, lacking
from gcs_formation.record.limits_by_truth import Truth
from gcs_formation.record.summary import Summary
from gcs_formation.recorder import Event

EVENT = "simulators"


def run_simulated(
    programs: Mapping[str, Path],
    scenario: Scenario,
    options: RunOptions,
    progress: Progress,
    interrupts: Interrupts,
) -> Summary:
    """Fly a scenario with simulators of the user's, which this starts and ends; `programs`: by family.

    Raises:
        ScenarioError: a vehicle can't be simulated by these programs.
        RunAbortedError: a port is taken, a vehicle refused, a simulator ended.
        RecordError: the run directory can't be written.
    """
    require_no_program(scenario)
    fleet = simulated(programs, scenario, options.speedup)
    import_ahead()
    clock = RealClock(options.speedup)
    session = Session(scenario, options, clock, progress, interrupts, emulated=False)
    session.ends_vehicles = True
    clocks = Clocks(session.station)
    try:
        resolve_peers(session)
        engine, replaced = forwarded(session)
        with (
            Driver(engine, clock) as driver,
            running(with_free_ports(fleet), options.out) as simulators,
            session.listening(),
        ):
            say_started(session, fleet, programs)
            for each in fleet:
                each.simulator.prepare(each.craft, time.monotonic)
            session.replace = replaced or driver.replace
            session.begin_to_wait()
            driver.run(partial(_over, session, simulators, clocks))
    except (PortError, SimulatorError) as error:
        raise session.could_not_begin(error) from error
    return session.conclude(_truth(session, fleet, simulators, clocks))


def _over(session: Session, simulators: Sequence[Running], clocks: Clocks) -> bool:
    """Attend to a flight, which fails if a simulator has ended; return whether it is over."""
    now, phase_machine = session.clock.now(), session.station.phase_machine
    if clocks.record_offsets(now) and phase_machine.failure is None and (text := ended(simulators)):
        phase_machine.fail(text, now)
    return session.attend()


def _truth(session: Session, fleet: Sequence[Simulated], simulators: Sequence[Running], clocks: Clocks) -> Truth | None:
    """Return the ground truth of the simulators' logs; without it, an event says why."""
    motions = dict[VehicleId, TrueMotion | None]()
    try:
        for each, one in zip(fleet, simulators, strict=True):
            motions[each.identity] = each.simulator.true_motion(one.directory)
    except (OSError, ValueError) as error:
        _say(session, f"no ground truth: {error}")
        return None
    if missing := lacking(motions, clocks):
        _say(session, f"no ground truth: {missing}")
        return None
    known = [motion for motion in motions.values() if motion is not None]
    offsets = [clocks.offsets[each.identity] for each in fleet]
    hovering = [each.craft.hovers for each in fleet]
    return LoggedTruth(known, offsets, hovering, session.scenario.origin.geodetic).between


def say_started(session: Session, fleet: Sequence[Simulated], programs: Mapping[str, Path]) -> None:
    """Record which programs fly, and what they fly without."""
    _say(session, f"{len(fleet)} started: {', '.join(f'{path}' for path in programs.values())}")
    for line in not_simulated(fleet):
        _say(session, line)


def _say(session: Session, text: str) -> None:
    session.recorder.event(Event(session.clock.now(), EVENT, text))
