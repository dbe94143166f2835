"""`fly`: a flight over UDP with vehicles that are there, from its start or resumed; or its rehearsal."""

from __future__ import annotations

from typing import Any

from airlink.clock import RealClock, seconds_between
from airlink.driver import Driver
from airlink.endpoint import Endpoint, PortError
from airlink.transports.udp import resolved
from formation_scenario import Scenario
from gcs_formation.app.dry_run import rehearsed
from gcs_formation.app.operator_at_terminal import Interrupts
from gcs_formation.app.progress import Progress
from gcs_formation.app.run import forwarded, import_ahead
from gcs_formation.app.run_options import RunOptions
from gcs_formation.app.session import Session
from gcs_formation.core.feature import NOT_RESUMED, features
from gcs_formation.errors import RecordError, RunAbortedError
from gcs_formation.mission.past_flight import PastFlight
from gcs_formation.record.run_directory import PORT, RECORDING
from gcs_formation.record.summary import Summary
from gcs_formation.record.unfinished import epoch_us, from_ports, read_past, recorded_speedup
from gcs_formation.recorder import Detail, Event


def rehearse(scenario: Scenario, options: RunOptions, progress: Progress, interrupts: Interrupts) -> dict[str, Any]:
    """Do all that `fly` does before the first command; return what vehicles would be sent.

    Raises:
        RunAbortedError: as `fly`, or it was interrupted before every vehicle was ready.
        RecordError: the run directory can't be written.
    """
    session = _flown(scenario, options, progress, interrupts)
    session.recorder.close()
    failure = session.station.phase_machine.failure
    if failure is not None or not session.station.gate.rehearsed:
        raise RunAbortedError(failure or "interrupted before every vehicle was ready")
    return rehearsed(session.station)


def fly(scenario: Scenario, options: RunOptions, progress: Progress, interrupts: Interrupts) -> Summary:
    """Fly a scenario over UDP.

    Raises:
        RunAbortedError: a port is taken, no vehicle answered, a vehicle refused.
        RecordError: the run directory can't be written.
    """
    return _flown(scenario, options, progress, interrupts).conclude(None)


def _flown(scenario: Scenario, options: RunOptions, progress: Progress, interrupts: Interrupts) -> Session:
    import_ahead()
    clock, begun, ports, behind_s = RealClock(options.speedup), None, dict[str, int](), 0.0
    if options.resume:
        clock, resumed, behind_s = taken_up(scenario, options)
        begun, ports = (epoch_us(options.out), resumed), from_ports(options.out)
    session = Session(scenario, options, clock, progress, interrupts, emulated=False, begun=begun)
    if behind_s > 0.0:
        session.recorder.event(Event(clock.now(), RECORDING, clock_behind(options, behind_s)))
    try:
        resolve_peers(session)
        with Driver(forwarded(session)[0], clock, ports) as driver, session.listening():
            for endpoint, port in driver.from_ports.items():
                details: dict[str, Detail] = {"endpoint": endpoint, "port": port}
                session.recorder.event(Event(clock.now(), PORT, f"{endpoint} from port {port}", None, details))
            driver.run(session.attend)
    except PortError as error:
        raise session.could_not_begin(error) from error
    return session


def clock_behind(options: RunOptions, behind_s: float) -> str:
    """Return in words that the machine's clock is behind the record that is continued, and a possible cause."""
    text = f"the machine's clock is {behind_s:.0f} s behind the record: time goes on from the record's end"
    began = recorded_speedup(options.out)
    if began == options.speedup:
        return text
    return f"{text}; the run began with --speedup {began:g}, and goes on with {options.speedup:g}"


def resolve_peers(session: Session) -> None:
    """Replace host names of vehicles' addresses by IP addresses, because answers come from these."""
    for _, each in session.station.each_link():
        link = each.connection
        if session.station.endpoints()[link.socket].kind == "udpout" and link.peer is not None:
            link.peer = resolved(Endpoint("udpout", link.peer)).address


def taken_up(scenario: Scenario, options: RunOptions) -> tuple[RealClock, PastFlight, float]:
    """Return the clock of a continued record, the flight's state, and how far the machine's clock is behind it, s.

    Raises:
        RecordError: as `read_past`; or no feature resumes flights.
    """
    if not any(each.resumes for each in features().values()):
        raise RecordError(NOT_RESUMED)
    clock = RealClock.from_utc(epoch_us(options.out), options.speedup)
    now = clock.now()
    resumed = read_past(options.out, scenario, now, take=options.take)
    behind_s = seconds_between(now, resumed.at)
    return (RealClock.at(resumed.at, options.speedup) if behind_s > 0.0 else clock), resumed, behind_s
