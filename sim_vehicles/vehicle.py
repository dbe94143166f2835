"""The main loop of an emulated vehicle: boot, messages received and sent, faults."""

from __future__ import annotations

from typing import Final

from mypy_extensions import mypyc_attr

from airlink.clock import NEVER, Instant, after
from airlink.engine import Datagram
from airlink.messages.system import Timesync
from formation_scenario.surroundings import Fault
from sim_vehicles.airframe.battery import Battery
from sim_vehicles.airframe.body import Body
from sim_vehicles.airframe.environment import Environment
from sim_vehicles.autopilot.autopilot import CRITICAL, Autopilot
from sim_vehicles.autopilot.faults import InjectedFaults
from sim_vehicles.autopilot.message_handler import MessageHandler
from sim_vehicles.autopilot.modes_and_failsafe import FlightMode, Request
from sim_vehicles.autopilot.onboard_log import LOG_FILE, OnboardLog
from sim_vehicles.autopilot.streams import Streams
from sim_vehicles.autopilot.telemetry import BUILDERS, write_state
from sim_vehicles.board_clock import BoardClock
from sim_vehicles.config import FleetConfig

INITIALISING_S: Final = 1.0
TIMESYNC_S: Final = 10.0
FIRST_REPORT_S: Final = 15.0
LOGS: Final = {"arduplane": "ArduPlane", "arducopter": "ArduCopter"}
"""Families that write logs of their own, and the firmwares' names there."""
REPORT_S: Final = 30.0
"""When after boot, and then how often, an ArduPilot says why it can't be armed (`AP_Arming::update`)."""


@mypyc_attr(allow_interpreted_subclasses=True)
class Vehicle(Autopilot):
    """An emulated autopilot that runs; a cycle of its main loop is `act`, `tell`, `stream`, `plan`."""

    builders = BUILDERS
    _frozen: bool
    _lasting: list[tuple[str, object]]
    """What lasts, and what holds it."""
    _up: Instant
    _next_timesync: Instant

    def __init__(self, index: int, fleet: FleetConfig, body: Body, environment: Environment, now: Instant) -> None:
        """Boot at `now`; a vehicle that starts in the air has booted at once."""
        super().__init__(index, fleet, body, environment)
        self.wake = now
        """When its next cycle has something to do."""
        self.faults = InjectedFaults(self)
        self.battery = None if self.config.battery is None else Battery(self.config.battery, now)
        writes = self.config.onboard_log and self.config.family in LOGS
        self.onboard_log = OnboardLog(LOGS[self.config.family]) if writes else None
        if self.onboard_log is not None:
            self.parameters.files.serve(LOG_FILE, self.onboard_log.copy)
        self._messages = self.make_message_handler()
        self._tells_time_at_once = self.tells_time_at_once
        self._boot(now, self.config.clock.offset_s)
        if self.config.start.in_air:
            self._come_up(self.air_mode)

    def make_message_handler(self) -> MessageHandler:
        """Return what takes its messages."""
        return MessageHandler(self)

    def receive(self, datagram: Datagram, now: Instant) -> None:
        """Keep a datagram for the main loop's next cycle at or after `now`: late cycles before it don't see it."""
        if self._tells_time_at_once and not (self._frozen or self.pilot.crashed):
            asked = self.link.time_asked(datagram, now)
            if asked is not None:
                commanded_ns = self.clock.nanoseconds(now) // 1000 * 1000
                answer = Timesync(commanded_ns, asked.ts1_ns, asked.target_system, asked.target_component)
                self.link.answer(datagram.peer, answer)
                return
        self.link.receive(datagram, now)
        self.wake = min(self.wake, now)

    # A cycle of the main loop, in the order in which the fleet has each vehicle run through it.

    def act(self, now: Instant) -> bool:
        """Boot, do what arrived frames ask for, and what is due; return False if it is frozen or has crashed."""
        self.now = now
        if self._frozen or self.pilot.crashed:
            self.link.ignore()
            self.wake = NEVER
            return False
        if self.pilot.booting and now >= self._up:
            self._come_up(self.ground_mode)
        if self.link.next_arrival <= now:
            for sender, frame in self.link.frames(now):
                self._messages.handle(sender, frame)
        if self.reboots:
            self.restart()
        if self.battery is not None:
            self.drain()
        if self.onboard_log is not None and self.onboard_log.due(now):
            write_state(self, self.onboard_log)
        if self.pilot.under_way and self.pilot.progress(self.body.motion):
            self.tell_heartbeat()
            if not self.pilot.airborne:
                self.landed()
        if now >= self.disarm_at:
            self.disarm_at = NEVER
            self.disarm(force=False)
        if now >= self.failsafe.deadline():
            self.lose_station()
        if now >= self.report_at:
            self._report()
        self.follow_time()
        return True

    def tell(self) -> bool:
        """Send what is due besides its streams; return whether one of these is."""
        now = self.now
        if now >= self.link.next_late:
            self.link.send_late(now)
        if now >= self._next_timesync:
            self._next_timesync = after(now, TIMESYNC_S)
            self.broadcast(Timesync(0, self.time_ns))
        listed = self.parameters.next_of_list()
        if listed is not None:
            self.link.answer(*listed)
        if self.onboard_log is not None and self.onboard_log.sending and not self.pilot.condition.armed:
            for peer, block in self.onboard_log.next_blocks():
                self.link.answer(peer, block)
        if now >= self.missions.next_due():
            for peer, message in self.missions.reminders(now):
                self.link.answer(peer, message)
        return now >= self.streams.next_due

    def stream(self) -> bool:
        """Send the next message of its streams that is due; return whether there is another."""
        return self.streams.send_next(self, self.link, self.now)

    def plan(self) -> None:
        """End the cycle: set when there is next something to do other than to read frames."""
        busy = self.parameters.listing or self.pilot.under_way or self.flies_mission
        if busy or self.onboard_log is not None:
            self.wake = self.now
            return
        # Compiled, `min` of two is a comparison; of more, it is a call.
        wake = min(self.streams.next_due, self._next_timesync)
        wake = min(wake, self._up if self.pilot.booting else NEVER)
        wake = min(wake, self.link.next_arrival)
        wake = min(wake, self.link.next_late)
        wake = min(wake, self.failsafe.deadline())
        wake = min(wake, self.report_at)
        wake = min(wake, self.missions.next_due())
        wake = min(wake, self.disarm_at)
        self.wake = min(wake, self.pilot.silent_at)

    def lose_station(self) -> None:
        """Do what its failsafe does when the ground station's heartbeats have stopped: in the air, change the mode."""
        mode = self.failsafe.trigger()
        if mode is not None and self.pilot.airborne:
            self.say(CRITICAL, f"GCS Failsafe On: {mode.name}")
            self.enter(mode)

    def _report(self) -> None:
        """Say why it can't be armed, if so."""
        self.report_at = after(self.now, REPORT_S)
        if not (self.armable or self.pilot.condition.armed):
            self.say(CRITICAL, f"PreArm: {self.unarmable}")

    def _boot(self, now: Instant, clock_offset_s: float) -> None:
        """Power up: only parameters, mission items and the motion are kept."""
        self.now = now
        self._frozen = self.ignores = self.reboots = False
        self._lasting = list[tuple[str, object]]()
        keys, utc_at_0_us = self.config.clock, self.fleet.utc_at_0_us
        error_s = keys.utc_error_s if keys.utc else None
        self.clock = BoardClock(now, clock_offset_s, keys.drift_ppm * 1e-6, utc_at_0_us, error_s)
        self._up = after(now, INITIALISING_S)
        self._next_timesync = after(now, TIMESYNC_S) if self.asks_time else NEVER
        self.disarm_at = NEVER
        self.report_at = after(now, FIRST_REPORT_S) if self.reports_unarmable else NEVER
        self.streams = Streams(now, self.unasked, self.builders)
        self.failsafe = self.make_failsafe()
        self.link.restart()
        self.missions.restart()
        self.pilot.restart(self.boot_mode)
        self.forget()

    def restart(self) -> None:
        """Reboot, if its condition allows it."""
        if self.pilot.request(Request.RESTART):
            self._boot(self.now, 0.0)

    def _come_up(self, mode: FlightMode) -> None:
        """End booting, in a mode of the pilot."""
        self.pilot.request(Request.BOOTED)
        self.pilot.enter(mode, self.body.motion)
        if self.pilot.airborne:
            self.pilot.fly_straight(self.body.motion)

    def inject(self, fault: Fault, now: Instant, *, ends: bool) -> None:
        """Begin or end a fault."""
        self.wake = self.now = now
        self.faults.inject(fault, ends=ends)

    def freeze(self, by: object, *, on: bool) -> None:
        """Hang for as long as anything holds it."""
        self._hold("freeze", by, on=on)
        self.streams.leave_out(self.now)

    def ignore(self, by: object, *, on: bool) -> None:
        """Acknowledge commands without carrying them out for as long as anything holds it."""
        self._hold("ignore", by, on=on)

    def take_over(self, mode: str | None) -> None:
        """Have its pilot take the sticks and change the mode; None: give it back, in the mode that is commanded."""
        self.sticks = mode is not None
        if not self._frozen:
            self.switch(self.guided_mode if mode is None else self.mode_named(mode))

    def _hold(self, what: str, by: object, *, on: bool) -> None:
        """Begin or end something that lasts; where two overlap the later end counts."""
        if on:
            self._lasting.append((what, by))
        elif (what, by) in self._lasting:
            self._lasting.remove((what, by))
        kinds = {each for each, _ in self._lasting}
        self._frozen, self.ignores = "freeze" in kinds, "ignore" in kinds
