"""`gcs-formation fly`: the ground station alone, against vehicles that are up already."""

from __future__ import annotations

from airlink.clock import RealClock
from airlink.errors import PortError
from airlink.udp import UdpDriver
from formation_scenario import Scenario
from gcs_formation.app.interrupt import Interrupts
from gcs_formation.app.options import RunOptions
from gcs_formation.app.progress import Progress
from gcs_formation.app.session import open_session
from gcs_formation.errors import RunAbortedError
from gcs_formation.record.summary import Summary


def fly(scenario: Scenario, options: RunOptions, progress: Progress, interrupts: Interrupts) -> Summary:
    """Fly a scenario over UDP.

    Raises:
        RunAbortedError: a port is taken, no vehicle answered, a vehicle refused.
        RecordError: the run directory can't be written.
    """
    clock = RealClock(options.speedup)
    session = open_session(scenario, options, clock, progress, interrupts, emulated=False)
    try:
        with UdpDriver(session.engine, clock) as driver, session.listening():
            driver.run(session.over)
    except PortError as error:
        session.recorder.close()
        raise RunAbortedError(str(error)) from error
    return session.conclude(None)
