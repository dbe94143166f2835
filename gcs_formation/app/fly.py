"""`gcs-formation fly`: the ground station alone, against vehicles that are up already."""

from __future__ import annotations

import time
from typing import Any

from airlink.clock import RealClock
from airlink.errors import PortError
from airlink.udp import UdpDriver
from formation_scenario import Scenario
from gcs_formation.app.interrupt import Interrupts
from gcs_formation.app.options import RunOptions
from gcs_formation.app.progress import Progress
from gcs_formation.app.rehearsal import rehearsed
from gcs_formation.app.session import Session, open_session
from gcs_formation.errors import RunAbortedError
from gcs_formation.record.past import Past, epoch_us, read_past
from gcs_formation.record.summary import Summary


def rehearse(scenario: Scenario, options: RunOptions, progress: Progress, interrupts: Interrupts) -> dict[str, Any]:
    """Do all that `fly` does up to the first command, and return what vehicles would be sent.

    Raises:
        RunAbortedError: as `fly`, or it was interrupted before every vehicle was ready.
        RecordError: the run directory can't be written.
    """
    session = _flown(scenario, options, progress, interrupts)
    session.recorder.close()
    failure = session.station.failure
    if failure is not None or not session.station.preflight.rehearsed:
        raise RunAbortedError(failure.text if failure else "interrupted before every vehicle was ready")
    return rehearsed(session.station)


def fly(scenario: Scenario, options: RunOptions, progress: Progress, interrupts: Interrupts) -> Summary:
    """Fly a scenario over UDP.

    Raises:
        RunAbortedError: a port is taken, no vehicle answered, a vehicle refused.
        RecordError: the run directory can't be written.
    """
    return _flown(scenario, options, progress, interrupts).conclude(None)


def _flown(scenario: Scenario, options: RunOptions, progress: Progress, interrupts: Interrupts) -> Session:
    clock, begun = RealClock(options.speedup), None
    if options.resume:
        began_us = epoch_us(options.out)
        clock = RealClock(options.speedup, time.monotonic_ns() - (time.time_ns() - began_us * 1000))
        begun = Past(began_us, read_past(options.out, scenario, clock.now(), retake=options.retake))
    session = open_session(scenario, options, clock, progress, interrupts, emulated=False, begun=begun)
    try:
        with UdpDriver(session.engine, clock) as driver, session.listening():
            driver.run(session.over)
    except PortError as error:
        session.recorder.close()
        raise RunAbortedError(str(error)) from error
    return session
