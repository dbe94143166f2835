"""`gcs-formation fly`: the ground station alone, against vehicles that are up already, or a rehearsal of that."""

from __future__ import annotations

import math
from collections.abc import Iterator
from typing import Any

from airlink import mavlink as m
from airlink.clock import RealClock
from airlink.endpoint import PortError
from airlink.messages import Message
from airlink.messages.command import CommandInt, CommandLong
from airlink.udp import UdpDriver
from flight_model.autopilot import FlightState, Setpoint
from formation_scenario import Scenario, slot_schedule
from formation_scenario.slot_assignment import columns
from gcs_formation.app.operator import Interrupts, RunOptions
from gcs_formation.app.progress import Progress
from gcs_formation.app.session import Session
from gcs_formation.errors import RunAbortedError
from gcs_formation.record.summary import Summary
from gcs_formation.record.unfinished import PORT, epoch_us, from_ports, read_past
from gcs_formation.recorder import Event
from gcs_formation.station import Station
from gcs_formation.vehicle.autopilot import Autopilot, Command
from gcs_formation.vehicle.vehicle import Vehicle

PARAMETERS = ("param1", "param2", "param3", "param4")
SETPOINTS = "setpoints"
"""Sent at every tick; the values are those of its slot at the path's start."""


def rehearsed(station: Station) -> dict[str, Any]:
    """Return what `--dry-run --json` prints: for each vehicle its state, its parameters' findings and the messages."""
    places = first_setpoints(station.scenario)
    return {
        "rate_hz": station.scenario.law.rate_hz,
        "dry_run": [
            {
                "vehicle": str(identity),
                "family": vehicle.autopilot.family,
                "mode": vehicle.autopilot.mode_name(vehicle.telemetry),
                "armed": vehicle.telemetry.armed,
                "airborne": vehicle.airborne,
                "parameters": list(station.preflight.warnings.get(identity, ())),
                "messages": list(_messages(vehicle, *places[str(identity)])),
            }
            for identity, vehicle in station.vehicles.items()
        ],
    }


def rehearsal_text(report: dict[str, Any]) -> str:
    """Return the same for a person."""
    lines: list[str] = []
    for each in report["dry_run"]:
        where = "in the air" if each["airborne"] else "on the ground"
        armed = "armed" if each["armed"] else "disarmed"
        lines.append(f"vehicle {each['vehicle']} ({each['family']}): {each['mode']}, {armed}, {where}")
        lines.extend(f"  parameters: {text}" for text in each["parameters"])
        for message in each["messages"]:
            when = f"setpoints, {report['rate_hz']:g} a second" if message["when"] == SETPOINTS else message["when"]
            values = ", ".join(f"{name} {_number(value)}" for name, value in message["values"].items())
            lines.append(f"  {when}: {message['message']} {message['command']}: {values or 'all 0'}")
    return "\n".join([*lines, "nobody was commanded; heartbeats and requests for telemetry and parameters were sent"])


def first_setpoints(scenario: Scenario) -> dict[str, tuple[Setpoint, FlightState]]:
    """Return each vehicle's setpoint in its slot when the leader is at the path's start, and where that is."""
    start, found = scenario.leader_path.at(0.0), dict[str, tuple[Setpoint, FlightState]]()
    ahead, aside = math.cos(start.course_rad), math.sin(start.course_rad)
    for vehicle, place_m in zip(columns(scenario), slot_schedule(scenario)[0].places_m.tolist(), strict=True):
        forward_m, right_m, up_m = place_m
        north_m = start.north_m + forward_m * ahead - right_m * aside
        east_m = start.east_m + forward_m * aside + right_m * ahead
        if vehicle is not None:
            commanded = Setpoint(scenario.path.speed_mps, start.course_rad, start.height_m + up_m)
            where = FlightState(
                north_m, east_m, commanded.height_m, 0.0, commanded.speed_mps, commanded.heading_rad, 0.0, 0.0
            )
            found[str(vehicle.vehicle_id)] = commanded, where
    return found


def _messages(vehicle: Vehicle, setpoint: Setpoint, where: FlightState) -> Iterator[dict[str, Any]]:
    autopilot, seen = vehicle.autopilot, vehicle.telemetry
    for step in autopilot.start_up(vehicle.rates_hz):
        if step.acts(seen) and not step.done(seen):
            yield from (_commanded("start", command, autopilot) for command in step.commands(seen))
    for message in autopilot.setpoint(setpoint, where):
        command = isinstance(message, CommandLong | CommandInt)
        yield _commanded(SETPOINTS, message, autopilot) if command else _sent(message)
    yield from (_commanded("end", command, autopilot) for command in autopilot.loiter(setpoint.height_m, seen))


def _commanded(when: str, command: Command, autopilot: Autopilot) -> dict[str, Any]:
    places = ("x", "y", "z", "frame") if isinstance(command, CommandInt) else ("param5", "param6", "param7")
    given = [name for name in (*PARAMETERS, *places) if getattr(command, name)]
    shown = max((PARAMETERS.index(name) + 1 for name in given if name in PARAMETERS), default=0)
    names = (*PARAMETERS[:shown], *(name for name in given if name not in PARAMETERS))
    mode, named = autopilot.mode_asked(command), m.name_of("MAV_CMD", command.command)
    if mode is not None:
        named = f"{named} ({autopilot.mode_names[mode]})"
    return {
        "when": when,
        "message": "COMMAND_INT" if isinstance(command, CommandInt) else "COMMAND_LONG",
        "command": named,
        "values": {name: _rounded(getattr(command, name)) for name in names},
    }


def _sent(message: Message) -> dict[str, Any]:
    """Return a setpoint that is no command: its values in SI units, without those that are 0."""
    values: dict[str, float] = message.values()
    fields = {name: _rounded(value) for name, value in values.items() if value and not name.startswith("target")}
    return {"when": SETPOINTS, "message": message.kind().name, "command": "", "values": fields}


def _rounded(value: float) -> float | None:
    """Return a value for JSON; None for NaN, which leaves a field to the vehicle."""
    return None if math.isnan(value) else round(float(value), 4)


def _number(value: float | None) -> str:
    """Return it as text, degrees in 1e-7 with all their digits."""
    return "unset" if value is None else f"{value:.10g}"


def rehearse(scenario: Scenario, options: RunOptions, progress: Progress, interrupts: Interrupts) -> dict[str, Any]:
    """Do all that `fly` does up to the first command, and return what vehicles would be sent.

    Raises:
        RunAbortedError: as `fly`, or it was interrupted before every vehicle was ready.
        RecordError: the run directory can't be written.
    """
    session = _flown(scenario, options, progress, interrupts)
    session.recorder.close()
    failure = session.station.course.failure
    if failure is not None or not session.station.preflight.rehearsed:
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
    clock, begun, ports = RealClock(options.speedup), None, dict[str, int]()
    if options.resume:
        began_us = epoch_us(options.out)
        clock = RealClock.from_utc(began_us, options.speedup)
        begun = began_us, read_past(options.out, scenario, clock.now(), retake=options.retake)
        ports = from_ports(options.out)
    session = Session(scenario, options, clock, progress, interrupts, emulated=False, begun=begun)
    try:
        with UdpDriver(session.engine, clock, ports) as driver, session.listening():
            for endpoint, port in driver.from_ports.items():
                details = {"endpoint": endpoint, "port": port}
                session.recorder.event(Event(clock.now(), PORT, f"{endpoint} from port {port}", None, details))
            driver.run(session.attend)
    except PortError as error:
        session.recorder.close()
        raise RunAbortedError(str(error)) from error
    return session
