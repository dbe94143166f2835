"""One emulated vehicle: its main loop, boot, faults, arming, and the messages that it sends without a request.

What it does with messages is in `autopilot.message_handler`; what each family overrides, in `autopilot_family`.
"""

from __future__ import annotations

from typing import TYPE_CHECKING, Final, assert_never

from airlink import mavlink as m
from airlink.clock import NEVER, Instant, after, seconds_between
from airlink.engine import Datagram
from airlink.messages import Message
from airlink.messages.system import Statustext, Timesync
from formation_scenario.surroundings import DEFAULT_MODE, Fault
from sim_vehicles.airframe.motion import Estimate, Motion
from sim_vehicles.airframe.sensors import sensors_of
from sim_vehicles.autopilot.board_clock import BoardClock
from sim_vehicles.autopilot.missions import Missions, home_of
from sim_vehicles.autopilot.modes_and_failsafe import FlightMode, GroundStationFailsafe, Request
from sim_vehicles.autopilot.telemetry import Streams
from sim_vehicles.autopilot_family import AutopilotFamily
from sim_vehicles.config import VehicleConfig
from sim_vehicles.link import Link

if TYPE_CHECKING:
    from sim_vehicles.fleet import Fleet

INITIALISING_S: Final = 1.0
TIMESYNC_S: Final = 10.0
INFO, WARNING, CRITICAL = m.MAV_SEVERITY_INFO, m.MAV_SEVERITY_WARNING, m.MAV_SEVERITY_CRITICAL


class Vehicle(AutopilotFamily):
    """An emulated autopilot and its body; a cycle of its main loop is `act`, `tell`, `stream`, `plan`."""

    now: Instant
    streams: Streams
    failsafe: GroundStationFailsafe
    disarm_at: Instant
    reboots: bool
    """Whether it was told to restart."""
    ignores: bool
    """Whether a fault has it acknowledge orders and do nothing."""
    _frozen: bool
    _lasting: list[Fault]
    """Faults that haven't ended."""
    _clock: BoardClock
    _up: Instant
    _next_timesync: Instant

    def __init__(self, index: int, config: VehicleConfig, fleet: Fleet, now: Instant) -> None:
        """Boot at `now`; a vehicle that starts in the air has booted at once."""
        self.index, self.config, self.fleet = index, config, fleet
        self.body = fleet.bodies[index]
        self.wake = now
        """When its next cycle has something to do."""
        self.parameters = self.parameters_of(config)
        self.pilot = self.pilot_of(config, self.body.steering)
        self.link = Link(index, config, locks=self.locks)
        self.missions = Missions(lambda: home_of(config.start, fleet.origin), stored=self.stores_missions)
        self._sensors = sensors_of(config, fleet.origin, fleet.config.seed)
        self.messages = self.message_handler()
        self._tells_time_at_once = self.tells_time_at_once
        self.sticks = False
        """Whether a pilot has its transmitter."""
        self._exact = Estimate(None)
        """The estimate of a vehicle whose sensors have no errors."""
        self._boot(now, config.clock_offset_s)
        if config.start.in_air:
            self._come_up(self.air_mode)

    def receive(self, datagram: Datagram, now: Instant) -> None:
        """Keep a datagram for the first cycle of the main loop from `now` on; earlier ones may still be made up for."""
        if self._tells_time_at_once and not (self._frozen or self.pilot.crashed):
            asked = self.link.time_asked(datagram, now)
            if asked is not None:
                told_ns = self._clock.nanoseconds(now) // 1000 * 1000
                self.link.answer(datagram.peer, Timesync(told_ns, asked.ts1_ns))
                return
        self.link.receive(datagram, now)
        self.wake = min(self.wake, now)

    # A cycle of the main loop, in the order in which the fleet has each vehicle run through it.

    def act(self, now: Instant) -> bool:
        """Boot, do what frames that have arrived ask for, and what is due; return False for one that does nothing."""
        self.now = now
        if self._frozen or self.pilot.crashed:
            self.link.ignore()
            self.wake = NEVER
            return False
        if self.pilot.booting and now >= self._up:
            self._come_up(self.ground_mode)
        if self.link.next_arrival <= now:
            for sender, frame in self.link.frames(now):
                self.messages.take(sender, frame)
        if self.reboots:
            self._restart()
        if self.pilot.under_way and self.pilot.progress(self.body.motion):
            self.tell_heartbeat()
            if not self.pilot.airborne:
                self.landed()
        if now >= self.disarm_at:
            self.disarm_at = NEVER
            self.disarm(force=False)
        safe_mode = self.failsafe.due_mode(now)
        if safe_mode is not None and self.pilot.airborne:
            self.say(CRITICAL, "Failsafe. Long event on: GCS")
            self.enter(safe_mode)
        self.follow_time()
        return True

    def tell(self) -> bool:
        """Send what is due besides its streams; return whether one of these is."""
        now = self.now
        if now >= self._next_timesync:
            self._next_timesync = after(now, TIMESYNC_S)
            self.broadcast(Timesync(0, self.time_ns))
        listed = self.parameters.next_of_list()
        if listed is not None:
            self.link.answer(*listed)
        if now >= self.missions.next_due():
            for peer, message in self.missions.reminders(now):
                self.link.answer(peer, message)
        return now >= self.streams.next_due

    def stream(self) -> bool:
        """Send the next message of its streams that is due; return whether there is another."""
        return self.streams.send_next(self, self.now)

    def plan(self) -> None:
        """End the cycle: set when there is next something to do other than to read frames."""
        if self.parameters.listing or self.pilot.under_way or self.flies_mission:
            self.wake = self.now
            return
        # Two by two: compiled, that is no call.
        wake = min(self.streams.next_due, self._next_timesync)
        wake = min(wake, self._up if self.pilot.booting else NEVER)
        wake = min(wake, self.link.next_arrival)
        wake = min(wake, self.failsafe.deadline())
        wake = min(wake, self.missions.next_due())
        wake = min(wake, self.disarm_at)
        self.wake = min(wake, self.pilot.silent_at)

    def _boot(self, now: Instant, clock_offset_s: float) -> None:
        """Power up: only parameters, mission items and the motion are kept."""
        self.now = now
        self._frozen = self.ignores = self.reboots = False
        self._lasting = list[Fault]()
        config, at_0_us = self.config, self.fleet.config.utc_at_0_us
        self._clock = BoardClock(now, clock_offset_s, config.clock_drift, at_0_us, config.utc_error_s)
        self._up = after(now, INITIALISING_S)
        self._next_timesync = after(now, TIMESYNC_S) if self.asks_time else NEVER
        self.disarm_at = NEVER
        self.streams = Streams(now, self.unasked, self.builders)
        self.failsafe = self.failsafe_of()
        self.link.restart()
        self.missions.restart()
        self.pilot.restart(self.boot_mode)
        self.forget()

    def _restart(self) -> None:
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
        match fault.kind:
            case "crash":
                self.crash(Request.CRASH)
            case "freeze":
                self._note_lasting(fault, ends=ends)
                self.streams.leave_out(now)
            case "ignore":
                self._note_lasting(fault, ends=ends)
            case "restart":
                self._restart()
            case "pilot":
                self.sticks = not ends
                if not self._frozen:
                    self.switch(self.guided_mode if ends else self.mode_named(fault.mode or DEFAULT_MODE))
            case _:
                assert_never(fault.kind)

    def _note_lasting(self, fault: Fault, *, ends: bool) -> None:
        """Begin or end a fault that lasts; where two overlap the later end counts."""
        if not ends:
            self._lasting.append(fault)
        elif fault in self._lasting:
            self._lasting.remove(fault)
        kinds = {each.kind for each in self._lasting}
        self._frozen, self.ignores = "freeze" in kinds, "ignore" in kinds

    def crash(self, request: Request) -> bool:
        """Fall to the ground, if its condition allows the request; return whether it did."""
        granted = self.pilot.request(request)
        if granted:
            self.body.ground()
        return granted

    def arm(self, *, force: bool) -> bool:
        """Arm; refused before the vehicle is ready, unless forced."""
        if not self.ready and not force and self.parameters["ARMING_CHECK"]:
            self.say(CRITICAL, "PreArm: AHRS: waiting for home")
            return False
        self.set_utc()
        before = self.pilot.condition.armed
        if not self.pilot.arm(self.body.motion):
            return False
        if not before:
            self.say(INFO, self.armed_text)
        self.tell_heartbeat()
        self.broadcast(self.builders[m.MAVLINK_MSG_ID_HOME_POSITION](self))
        return True

    def disarm(self, *, force: bool) -> bool:
        """Disarm; refused in flight, unless forced: then it crashes."""
        before = self.pilot.condition.armed
        if force and self.pilot.airborne:
            granted = self.crash(Request.FORCE_DISARM)
        else:
            granted = self.pilot.request(Request.FORCE_DISARM if force else Request.DISARM)
        if granted and before:
            self.say(INFO, self.disarmed_text)
        if granted:
            self.tell_heartbeat()
        return granted

    def tell_heartbeat(self) -> None:
        """Send a HEARTBEAT now, to all peers."""
        self.broadcast(self.builders[m.MAVLINK_MSG_ID_HEARTBEAT](self))

    def say(self, severity: int, text: str) -> None:
        """Send a text for the operator to all peers."""
        self.broadcast(Statustext(severity, text))

    def broadcast(self, message: Message) -> None:
        """Send a message to all peers."""
        self.link.broadcast(message, self.now)

    @property
    def ready(self) -> bool:
        """Whether it may be armed, or is in the air."""
        up_s = seconds_between(self._clock.booted, self.now)
        return not self.pilot.booting and (self.pilot.airborne or up_s >= self.fleet.config.ready_s)

    @property
    def time_ns(self) -> int:
        """Nanoseconds since boot by the vehicle's own clock, which counts microseconds."""
        return self._clock.nanoseconds(self.now) // 1000 * 1000

    @property
    def time_s(self) -> float:
        """Seconds since boot by the vehicle's own clock."""
        return self._clock.seconds(self.now)

    @property
    def utc_us(self) -> int:
        """UTC as it knows it, microseconds since 1970."""
        self.set_utc()
        return self._clock.utc_us(self.now)

    def set_utc(self) -> None:
        """Set UTC by the GNSS receiver, as long as it is disarmed."""
        if not self.pilot.condition.armed:
            self._clock.set_by_receiver(self.now)

    @property
    def sensed(self) -> Motion:
        """Its motion as its sensors measure it, for telemetry; its own control loops use the truth."""
        motion = self.body.shown()
        return motion if self._sensors is None else self._sensors.sense(motion, self.now)

    @property
    def estimate(self) -> Estimate:
        """What its state estimate and its receiver say, for telemetry."""
        if self._sensors is not None:
            return self._sensors.estimate(self.body.motion, self.now)
        self._exact.received = self.body.motion
        return self._exact
