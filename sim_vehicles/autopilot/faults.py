"""Faults of an emulated vehicle: ours, and how these and those of extensions act on it."""

from __future__ import annotations

import sys
from functools import partial
from typing import Any, Final

from pydantic import BaseModel

from airlink.clock import NANOSECONDS, Instant
from airlink.random_streams import random_stream
from airlink.telemetry_faults import Effect, Quantity, Vector
from airlink.telemetry_faults.altering import TelemetryFault
from formation_scenario.extensions import FAULT, ExtensionError, Registered, registered_in
from formation_scenario.simulated import EmulatedVehicle, Measured, VehicleFault, register_fault
from formation_scenario.surroundings import DEFAULT_MODE, Fault
from sim_vehicles.airframe.measured import measured_of, with_measured
from sim_vehicles.airframe.motion import Motion
from sim_vehicles.autopilot.autopilot import WARNING, Autopilot
from sim_vehicles.autopilot.modes_and_failsafe import Request
from sim_vehicles.outside import Guarded, reference

LIMITS: Final = (
    "tau_v_s",
    "tau_psi_s",
    "tau_ha_s",
    "tau_hb_s",
    "speed_min_mps",
    "speed_max_mps",
    "accel_max_mps2",
    "turn_rate_max_rps",
    "climb_max_mps",
)


@register_fault("crash")
class Crash(VehicleFault):
    """It lies on the ground and is silent."""

    lasts = False
    crashes = silences = True

    def strike(self, vehicle: EmulatedVehicle) -> None:
        """Fall."""
        vehicle.crash()


@register_fault("freeze")
class Freeze(VehicleFault):
    """Its autopilot hangs, and it flies on by its last setpoint."""

    silences = True

    def strike(self, vehicle: EmulatedVehicle) -> None:
        """Hang."""
        vehicle.freeze(on=True)

    def end(self, vehicle: EmulatedVehicle) -> None:
        """Go on, unless another fault keeps it."""
        vehicle.freeze(on=False)


@register_fault("ignore")
class Ignore(VehicleFault):
    """It acknowledges commands without carrying them out."""

    def strike(self, vehicle: EmulatedVehicle) -> None:
        """Do nothing from now on."""
        vehicle.ignore(on=True)

    def end(self, vehicle: EmulatedVehicle) -> None:
        """Go on, unless another fault keeps it."""
        vehicle.ignore(on=False)


@register_fault("restart")
class Restart(VehicleFault):
    """Its autopilot reboots, with its clock at 0."""

    lasts = False

    def strike(self, vehicle: EmulatedVehicle) -> None:
        """Reboot."""
        vehicle.restart()


@register_fault("pilot")
class Pilot(VehicleFault):
    """Its pilot changes the mode, and changes it back to where it is commanded at the end."""

    class Keys(BaseModel):
        """Of the entry itself."""

        mode: str = DEFAULT_MODE

    def strike(self, vehicle: EmulatedVehicle) -> None:
        """Take the sticks."""
        vehicle.take_over(self.keys.mode)

    def end(self, vehicle: EmulatedVehicle) -> None:
        """Give the vehicle back."""
        vehicle.take_over(None)


@register_fault("telemetry")
class Telemetry(VehicleFault):
    """Its messages say something else of one quantity; it flies on by what it knows."""

    class Keys(BaseModel):
        """Of the entry itself."""

        quantity: Quantity
        effect: Effect
        amount: float | Vector | None = None

    altered: TelemetryFault
    """What it does to messages, once it has begun."""

    def strike(self, vehicle: EmulatedVehicle) -> None:
        """Begin to alter messages."""
        keys, began = self.keys, Instant(round(vehicle.time_s * NANOSECONDS))
        self.altered = TelemetryFault(keys.quantity, keys.effect, keys.amount, self.random, began)


OURS: Final[dict[str, Registered]] = registered_in(sys.modules[__name__], FAULT)


class _Struck(EmulatedVehicle):
    """A vehicle as one fault acts on it."""

    def __init__(self, autopilot: Autopilot) -> None:
        self._autopilot = autopilot
        self.id = reference(autopilot.config.identity)

    @property
    def time_s(self) -> float:
        return self._autopilot.now / NANOSECONDS

    @property
    def true(self) -> Measured:
        return measured_of(self._autopilot.body.motion)

    def crash(self) -> None:
        self._autopilot.crash(Request.CRASH)

    def restart(self) -> None:
        self._autopilot.restart()

    def freeze(self, *, on: bool) -> None:
        self._autopilot.freeze(self, on=on)

    def ignore(self, *, on: bool) -> None:
        self._autopilot.ignore(self, on=on)

    def take_over(self, mode: str | None) -> None:
        self._autopilot.take_over(mode)

    def limit(self, **limits: float) -> None:
        known = self._autopilot.config.model.autopilot()
        for name in LIMITS:
            setattr(self._autopilot.body.model, name, getattr(known, name))
        for name, value in limits.items():
            if name not in LIMITS or not 0.0 <= value < float("inf"):
                raise ValueError(f"found {name}={value}; allowed: numbers from 0 for {', '.join(LIMITS)}")
            setattr(self._autopilot.body.model, name, float(value))

    def say(self, text: str) -> None:
        self._autopilot.say(WARNING, str(text))


class InjectedFaults:
    """The faults of one vehicle."""

    def __init__(self, autopilot: Autopilot) -> None:
        """Start without any."""
        self._autopilot = autopilot
        self._known = autopilot.fleet.registered
        self._struck: list[tuple[Fault, Guarded, _Struck]] = []
        """Those that haven't ended, with the vehicle as they act on it."""
        self._number = 0

    @property
    def acting(self) -> bool:
        """Whether any acts in each cycle of the main loop."""
        return any(_overrides(each, "act") for _, each, _ in self._struck)

    def inject(self, fault: Fault, *, ends: bool) -> None:
        """Begin or end a fault."""
        known = next((entry for entry in self._struck if entry[0] == fault), None) if ends else None
        try:
            _, guarded, vehicle = known or self._new(fault)
        except ExtensionError as error:
            self._autopilot.environment.failures.add(str(error))
            return
        if not ends:
            self._struck.append((fault, guarded, vehicle))
        elif known is not None:
            self._struck.remove(known)
        instance: VehicleFault = guarded.instance
        guarded.call(partial(instance.end if ends else instance.strike, vehicle), None)
        distorts = any(_overrides(each, "measure") for _, each, _ in self._struck)
        self._autopilot.distort = self._distorted if distorts else None
        instances = [each.instance for _, each, _ in self._struck]
        self._autopilot.link.altering = [each.altered.sent for each in instances if isinstance(each, Telemetry)]

    def act(self) -> None:
        """Let each act in this cycle."""
        for _, guarded, vehicle in self._struck:
            instance: VehicleFault = guarded.instance
            guarded.call(partial(instance.act, vehicle), None)

    def _new(self, fault: Fault) -> tuple[Fault, Guarded, _Struck]:
        identity, self._number = self._autopilot.config.identity, self._number + 1
        given: dict[str, Any] = {
            "vehicle": reference(identity),
            "random": random_stream(self._autopilot.fleet.seed, "fault", self._number, *identity),
        }
        entry = self._known.get(fault.kind, FAULT) or OURS[fault.kind]
        guarded = Guarded(entry, fault.own_keys, self._autopilot.environment.failures, **given)
        return fault, guarded, _Struck(self._autopilot)

    def _distorted(self, motion: Motion, now: Instant) -> Motion:
        """Return a motion as telemetry has it."""
        for _, guarded, _ in self._struck:
            instance: VehicleFault = guarded.instance
            measured = measured_of(motion)
            found = guarded.finite(partial(instance.measure, measured, now / NANOSECONDS), len(measured))
            motion = motion if found is None or found == measured else with_measured(motion, found)
        return motion


def _overrides(guarded: Guarded, method: str) -> bool:
    return getattr(type(guarded.instance), method) is not getattr(VehicleFault, method)
