"""What a dry run shows: each vehicle as it was found, and the messages that a flight would send it."""

from __future__ import annotations

import math
from collections.abc import Iterator
from typing import Any

from airlink import mavlink as m
from airlink.messages import Message
from airlink.messages.command import CommandInt, CommandLong
from flight_model.arrays import offset_points
from flight_model.flight_state import FlightState, Setpoint
from formation_scenario import Scenario
from formation_scenario.slot_assignment import slot_schedule, vehicles_by_index
from formation_scenario.slot_frame import axis_rad
from gcs_formation.station import Station
from gcs_formation.vehicle.autopilot_family import Autopilot
from gcs_formation.vehicle.startup_step import Command
from gcs_formation.vehicle.vehicle import Vehicle

PARAMETERS = ("param1", "param2", "param3", "param4")
SETPOINTS = "setpoints"
"""`when` of messages that are sent at every tick; their values are those of the slot at the path's start."""


def rehearsed(station: Station) -> dict[str, Any]:
    """Return what `--dry-run --json` prints: each vehicle's state, its parameters' findings and the messages."""
    setpoints = first_setpoints(station.scenario)
    return {
        "rate_hz": station.scenario.law.rate_hz,
        "dry_run": [
            {
                "vehicle": str(identity),
                "family": vehicle.autopilot.family,
                "mode": vehicle.autopilot.mode_name(vehicle.telemetry),
                "armed": vehicle.telemetry.armed,
                "airborne": vehicle.airborne,
                "parameters": list(station.gate.warnings.get(identity, ())),
                "messages": list(_messages(vehicle, *setpoints[str(identity)])),
            }
            for identity, vehicle in station.vehicles.items()
        ],
    }


def rehearsal_text(report: dict[str, Any]) -> str:
    """Return the same as text, with all digits of degrees in 1e-7."""
    lines: list[str] = []
    for each in report["dry_run"]:
        where, armed = "in the air" if each["airborne"] else "on the ground", "armed" if each["armed"] else "disarmed"
        lines.append(f"vehicle {each['vehicle']} ({each['family']}): {each['mode']}, {armed}, {where}")
        lines.extend(f"  parameters: {text}" for text in each["parameters"])
        for message in each["messages"]:
            when = f"setpoints, {report['rate_hz']:g} a second" if message["when"] == SETPOINTS else message["when"]
            given = {name: "unset" if value is None else f"{value:.10g}" for name, value in message["values"].items()}
            values = ", ".join(f"{name} {value}" for name, value in given.items())
            what = f"{message['message']} {message['command']}".rstrip()
            lines.append(f"  {when}: {what}: {values or 'all 0'}")
    return "\n".join(
        [*lines, "no vehicle was commanded; heartbeats and requests for telemetry and parameters were sent"]
    )


def first_setpoints(scenario: Scenario) -> dict[str, tuple[Setpoint, FlightState]]:
    """Return each vehicle's setpoint when the leader is at the path's start, and its state in its slot there."""
    start, found = scenario.leader_path.at(0.0), dict[str, tuple[Setpoint, FlightState]]()
    axis = axis_rad(scenario.formation.frame, start.course_rad, start.course_rad)
    for vehicle, place_m in zip(
        vehicles_by_index(scenario), slot_schedule(scenario)[0].positions_m.tolist(), strict=True
    ):
        if vehicle is not None:
            forward_m, right_m, up_m = place_m
            north_m, east_m = offset_points(start.north_m, start.east_m, axis, forward_m, right_m)
            speed_mps, psi_rad, height_m = scenario.path.begin_mps, start.course_rad, start.height_m + up_m
            where = FlightState(float(north_m), float(east_m), height_m, 0.0, speed_mps, psi_rad, 0.0, 0.0)
            found[str(vehicle.vehicle_id)] = Setpoint(speed_mps, psi_rad, height_m), where
    return found


def _messages(vehicle: Vehicle, setpoint: Setpoint, where: FlightState) -> Iterator[dict[str, Any]]:
    autopilot, seen = vehicle.autopilot, vehicle.telemetry
    for step in autopilot.start_up(vehicle.rates_hz):
        if step.acts(seen) and not step.done(seen):
            yield from (_commanded("start", command, autopilot) for command in step.commands(seen))
    for message in autopilot.setpoint(setpoint, where):
        if isinstance(message, CommandLong | CommandInt):
            yield _commanded(SETPOINTS, message, autopilot)
        else:
            yield _sent(message)
    yield from (_commanded("end", command, autopilot) for command in autopilot.loiter(setpoint.height_m, seen))


def _commanded(when: str, command: Command, autopilot: Autopilot) -> dict[str, Any]:
    further = ("x", "y", "z", "frame") if isinstance(command, CommandInt) else ("param5", "param6", "param7")
    given = [name for name in (*PARAMETERS, *further) if getattr(command, name)]
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
    """Return a setpoint that isn't a command: its non-zero values in SI units."""
    values: dict[str, float] = message.values()
    fields = {name: _rounded(value) for name, value in values.items() if value and not name.startswith("target")}
    return {"when": SETPOINTS, "message": message.kind().name, "command": "", "values": fields}


def _rounded(value: float) -> float | None:
    """Return a value for JSON; None for NaN, which leaves a field to the vehicle."""
    return None if math.isnan(value) else round(float(value), 4)
