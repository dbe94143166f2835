"""One flight from start to summary, under either clock: the common part of `run` and `fly`."""

from __future__ import annotations

import json
import math
import sys
from collections.abc import Callable, Collection

from airlink.cli import counted
from airlink.clock import MICROSECONDS, Clock, Instant, Stopwatch, after
from airlink.endpoint import PortError, VehicleId
from airlink.engine import Engine
from formation_scenario import Scenario, ScenarioError
from formation_scenario.extensions import ExtensionError
from formation_scenario.orders import Answer
from formation_scenario.simulated import Place
from formation_scenario.slot_assignment import ids_by_index
from gcs_formation.app.conclusion import Conclusion, FlightTimes, InjectedLinks
from gcs_formation.app.link_injection import (
    InjectedDelays,
    InjectedFaults,
    LinkSchedule,
    wrapped,
)
from gcs_formation.app.link_processes import UNKNOWN
from gcs_formation.app.operator_at_terminal import Confirmation, Interrupts
from gcs_formation.app.order_socket import CHECK, LINK, STATUS, OrderSocket
from gcs_formation.app.progress import Progress
from gcs_formation.app.result_text import status_page
from gcs_formation.app.run_options import RunOptions
from gcs_formation.app.script import Script, scripted
from gcs_formation.app.signing import flight_signing, open_links
from gcs_formation.app.timed_station import TimedStation
from gcs_formation.errors import RecordingError, RunAbortedError
from gcs_formation.extend.in_flight import Sinks, sinks
from gcs_formation.mission.gate import PreFlightOptions
from gcs_formation.mission.past_flight import PastFlight
from gcs_formation.phases import Phase
from gcs_formation.record.limits_by_truth import Truth
from gcs_formation.record.run_directory import FLUSH_S, GOES_ON, RECORDING, SPOOL, RunDirectory
from gcs_formation.record.summary import Summary
from gcs_formation.record.timeseries import Spool
from gcs_formation.record.unfinished import set_before
from gcs_formation.recorder import Event

MAX_DIGITS = 5
LOOK_S = 1.0
"""Time between looks at the ground truth of silent vehicles, s."""
LOOKS_EVERY = 16
"""Events between looks at the wall clock for progress: there are about fifty a second for each vehicle."""
PROGRESS_S = 0.25
"""Wall time between updates of the progress, s."""
REMINDER_S = 20.0
"""Wall time between lines that say what is waited for, in a log."""
WATCHED_FLUSH_S = 0.09
"""Wall time between writes of the record while somebody may look on: at 10 Hz each tick is written at once."""
FAST_SPEEDUP = 10.0
"""A --speedup above this may be too high for the machine: 30 s of flight then pass in under 3 s of wall time."""


def _opened(scenario: Scenario, options: RunOptions, began_us: int, *, resume: bool) -> RunDirectory:
    """Open the record, and say so to who looks on."""
    watched = options.recording is not None
    keeps = options.record in {"full", "series"} or options.clock == "real"  # whose emulators read the file
    recorder = RunDirectory(
        options.out,
        scenario if keeps else None,
        ids_by_index(scenario),
        began_us,
        overwrite=options.overwrite,
        frames=options.record == "full",
        resume=resume,
        flush_s=WATCHED_FLUSH_S * options.speedup if watched else FLUSH_S,
    )
    if options.recording is not None:
        options.recording()
    return recorder


class Session:
    """A station with its record, from the first tick to the summary."""

    lying: Callable[[], Collection[VehicleId]] | None = None
    """Returns which vehicles lie on the ground by ground truth, where there is any."""
    replace: Callable[[Engine], None] | None = None
    """Lets an engine that wraps the flight's take its place on the network."""
    emulators_failure: Callable[[], str | None] | None = None
    """Returns what failed of the emulated vehicles' extensions, if they have any."""
    ends_vehicles = False
    """Whether its vehicles end with the flight: nothing is left with which `fly --resume` could go on."""
    _orders: OrderSocket | None = None
    _is_restored = False
    """Whether parameters that were set have their values back."""
    _events = 0
    """Number of events so far."""
    _left_at: Instant | None = None
    """When the flight ended, or the operator left it."""

    def __init__(
        self,
        scenario: Scenario,
        options: RunOptions,
        clock: Clock,
        progress: Progress,
        interrupts: Interrupts,
        *,
        emulated: bool,
        begun: tuple[int, PastFlight] | None = None,
    ) -> None:
        """Open the record, impair the links, and start to measure wall time.

        Args:
            scenario: what is flown.
            options: how, and where it is recorded.
            clock: the run's.
            progress: shows the run's progress.
            interrupts: counts the operator's signals.
            emulated: whether the vehicles are our emulators, which simulate the scenario's faults, over links that add
                nothing to the injected delays.
            begun: for a flight that is continued, when its clock began, microseconds since 1970, and its state.

        Raises:
            RecordError: the run directory can't be written, or holds other files.
            ScenarioError: a link's key file can't be used.
        """
        self.scenario, self.options, self.clock = scenario, options, clock
        self.signing, self.progress, self.interrupts, self.emulated = (
            flight_signing(scenario, clock),
            progress,
            interrupts,
            emulated,
        )
        began_us, resumed = begun or (clock.utc_at_0_us, None)
        self.recorder = _opened(scenario, options, began_us, resume=resumed is not None)
        read = not emulated and resumed is None
        caution = PreFlightOptions(read, options.confirm, options.dry_run, options.set_parameters, options.take)
        self._keeps_utc = emulated if (given := scenario.telemetry.station_utc) is None else given
        utc_s = began_us / MICROSECONDS if self._keeps_utc else None
        self.station = TimedStation(
            scenario, self.recorder, options.until_s, utc_s, caution, resumed, self.signing.links
        )
        if resumed is None and options.speedup != 1.0:
            details = {"speedup": options.speedup}
            self.recorder.event(Event(Instant(0), RECORDING, f"with --speedup {options.speedup:g}", None, details))
        if resumed is not None:
            self.station.gate.restoration.take_over(set_before(self.recorder.path))
            self.recorder.event(Event(resumed.at, RECORDING, GOES_ON, None, {"epoch_us": began_us}))
        schedule = LinkSchedule(scenario, self.station.flight)
        self.link_processes, schedule.processes.positions = schedule.processes, self._reported
        self.script = Script(scenario, self.station, self.recorder, (schedule, self._impair), repeats=resumed is None)
        self._links = wrapped(self.station, schedule)
        self.engine: Engine = self._links or self.station
        self._injected = InjectedDelays(self.station.vehicles, self._links, 0.0 if emulated else math.nan, self._number)
        self._faults = InjectedFaults(scenario, self.recorder) if emulated else None
        self._spent, self._began_at, self._resumed = Stopwatch(), self.station.flight.since, resumed
        self._shown_s, self._reminded_s, self._next_look = 0.0, 0.0, Instant(0)
        self._confirmation = self._confirming() if options.confirm else None
        self.recorder.tell_events_to(self._show_event)
        self._sinks = self._opened_sinks()
        whom = counted(len(self.station.vehicles), "vehicle")
        self._show_event(Event(self._began_at, "phase", f"{Phase.CONNECTING.value} to {whom}"))

    def _keep_timestamps(self) -> None:
        """Keep the timestamps of signatures in time; say so once if that fails."""
        known = self.signing.failure
        self.signing.keep(self.clock.now())
        if self.signing.failure is not None and known is None:
            self.recorder.event(Event(self.clock.now(), "signing", self.signing.failure))

    def listening(self) -> OrderSocket:
        """Return the socket that takes orders for this flight, as a context manager; say which links are open."""
        for text in open_links(self.scenario):
            self.recorder.event(Event(self.station.flight.since, "signing", text))
        self._orders = OrderSocket(self.options.out, self._answer)
        return self._orders

    def _impair(self, schedule: LinkSchedule) -> None:
        """Put links that a program has changed around the station, unless they are there."""
        links = wrapped(self.station, schedule)
        if self._links is None and links is not None and self.replace is not None:
            self._links = self.engine = links
            self._injected.attach(links)
            self.replace(links)

    def attend(self) -> bool:
        """Serve the operator and show progress, after every event; return whether the flight has ended."""
        if self.recorder.failure is not None and self.station.phase_machine.failure is None:
            self.station.phase_machine.fail(self.recorder.failure, self.clock.now())
        if self._sinks is not None and self._sinks.failure is not None and self.station.phase_machine.failure is None:
            self.station.phase_machine.fail(self._sinks.failure, self.clock.now())
        if self.emulators_failure is not None or self.link_processes.failure is not None:
            self._check_extensions()
        if self.lying is not None and self.station.cycle.findings.silent_aloft and self.clock.now() >= self._next_look:
            self._next_look = after(self.clock.now(), LOOK_S)
            self.station.cycle.findings.lie(self.lying())
        left = self.interrupts.count > 0 and self.interrupts.process(self.station.phase_machine, self.clock.now())
        self._injected.record(self.station.recorded_ticks)
        if self.recorder.is_in_subdirectory and self.station.commands_anybody:
            self.recorder.replace_earlier()
        if self._faults is not None and self._faults.pending:
            self._faults.record_due(self.station.flight, self.clock.now())
        if self.script.pending:
            self.script.attend(self.clock.now())
        if self.signing.links is not None:
            self._keep_timestamps()
        if self._orders is not None:
            self._orders.poll()
        if self._confirmation is not None:
            self._confirmation.poll(self.clock.now())
        self._events += 1
        if self._events % LOOKS_EVERY == 0:
            self._show_progress(self._spent.wall_s)
        if not (self.station.flight.ended or left):
            return False
        self._left_at = self._left_at or self.clock.now()
        return self._has_restored()

    def _has_restored(self) -> bool:
        """Return whether the parameters that were set have their values back, or can't get them; begin that."""
        restoration, now = self.station.gate.restoration, self.clock.now()
        if self._is_restored or not restoration.has_some:
            return True
        restoration.begin(now)
        self._is_restored = restoration.over(now)
        return self._is_restored

    def _show_progress(self, wall_s: float) -> None:
        if wall_s - self._shown_s > PROGRESS_S:
            self._shown_s = wall_s
            self.progress.show(self.station)
        if wall_s - self._reminded_s > REMINDER_S:
            self._reminded_s = wall_s
            self.progress.remind(self.station, self.clock.now())

    def _check_extensions(self) -> None:
        """Fail if an extension of the emulated vehicles or of the links has failed."""
        failure = self.link_processes.failure
        if failure is None and self.emulators_failure is not None:
            failure = self.emulators_failure()
        if failure is not None and self.station.phase_machine.failure is None:
            self.station.phase_machine.fail(failure, self.clock.now())

    def _reported(self, vehicle: VehicleId) -> Place:
        """Return where a vehicle last said that it is."""
        motion = self.station.vehicles[vehicle].telemetry.motion
        return UNKNOWN if motion is None else Place(motion.north_m, motion.east_m, motion.height_m)

    def could_not_begin(self, error: PortError | ExtensionError | RunAbortedError) -> RunAbortedError:
        """Conclude a run without a port, an extension or a simulator; return what to raise.

        A resumed run can be resumed again.
        """
        if self._resumed is not None:
            self.recorder.close()
            return RunAbortedError(str(error))
        self.station.phase_machine.fail(str(error), self.clock.now(), begun=False)
        try:
            self.conclude(None)
        except RunAbortedError as failed:
            return failed
        return RunAbortedError(str(error))

    def begin_to_wait(self) -> None:
        """Start the vehicles' time to answer now: they weren't up before."""
        self.station.flight.resume(self.clock.now(), None)

    def _confirming(self) -> Confirmation:
        def decline(reason: str) -> None:
            self.station.phase_machine.fail(reason, self.clock.now())

        return Confirmation(self.station.gate, self.recorder, sys.stdin.fileno(), decline)

    def conclude(self, truth: Truth | None) -> Summary:
        """Close the record, and write the time series and the summary, also of a flight that failed.

        Without a summary is a flight that `fly --resume` can go on with.

        Raises:
            RunAbortedError: the station or its record failed; what was recorded is kept.
        """
        wall_s, phase_machine = self._spent.wall_s, self.station.phase_machine
        self._close_sinks()
        self.signing.keep()
        if self.script.has_new:
            self.recorder.record_scenario(self.script.recorded())
        self.recorder.close()
        if self.recorder.failure is not None:
            raise RecordingError(self.recorder.failure)
        failure = None if phase_machine.failure is None else phase_machine.failure + self._if_too_fast()
        begun = self._resumed is not None or bool(Spool(self.recorder.path / SPOOL).ticks)
        resumable = begun and not (self.emulated or self.ends_vehicles or phase_machine.flown)
        if failure is not None and resumable:  # by `fly --resume`, from what is recorded
            raise RunAbortedError(failure)
        try:
            summary = self._conclusion().summary(truth, wall_s)
        except OSError as error:
            raise RecordingError(f"cannot write to {self.recorder.path}: {error.strerror or error}") from error
        if summary.figures["failure"] is not None:  # the flight's, or a metric's of an extension after it
            raise RunAbortedError(summary.figures["failure"] + self._if_too_fast(), summary.to_dict())
        return summary

    def _conclusion(self) -> Conclusion:
        self.scenario = self.script.as_planned()
        times = FlightTimes(self._began_at, self._ended, self.clock.now())
        injected_links = InjectedLinks(self._injected, self._links, self.emulated, self._keeps_utc)
        return Conclusion(self.station, self.recorder, self.scenario, self.options, times, injected_links)

    def _opened_sinks(self) -> Sinks | None:
        """Return the flight's recorders from outside, which receive every tick; None if it has none."""
        found = sinks(self.scenario, self.recorder.path)
        if found is not None:
            self.recorder.tell_ticks_to(found.tick)
        return found

    def _close_sinks(self) -> None:
        if self._sinks is not None:
            self._sinks.close()
            if self._sinks.failure is not None:
                self.station.phase_machine.failure = self.station.phase_machine.failure or self._sinks.failure

    def _if_too_fast(self) -> str:
        """Return the note that a high --speedup may have caused a failure; "" at a lower speedup."""
        speedup = self.options.speedup
        return (
            f" (with --speedup {speedup:g}, which this machine may be too slow for)" if speedup > FAST_SPEEDUP else ""
        )

    def _answer(self, text: str) -> Answer:
        """Return the answer to a line of `tell` or of the page: on the flight, or what came of an order."""
        asked, *width = text.split()[:2] or [""]
        now = self.clock.now()
        if asked == STATUS:
            given = (int(each) for each in width if each.isdecimal() and len(each) < MAX_DIGITS)
            return Answer(True, status_page(self.station, now, *given))
        if asked == CHECK:
            return self.station.orders.consider(text.partition(CHECK)[2].strip(), now)
        if asked == LINK:
            return self._change_links(text.partition(LINK)[2], now)
        return self.station.orders.execute(text, now)

    def _change_links(self, text: str, now: Instant) -> Answer:
        """Impair links as JSON says, with the keys of `links.changes`."""
        if not self.emulated:
            return Answer(False, "links aren't impaired here; allowed: in a flight of `run`")
        try:
            keys = json.loads(text)
            act = scripted(self.scenario, {"link": keys}).model_copy(update={"at_tick": self.station.recorded_ticks})
            return self.script.do(act, now)
        except (ScenarioError, ValueError) as error:
            return Answer(False, str(error))

    def _show_event(self, event: Event) -> None:
        self.progress.show_event(event, self.station.flight.mission_time_s(event.now))
        if self._sinks is not None:
            self._sinks.event(event)

    @property
    def _ended(self) -> Instant:
        return self._left_at or self.clock.now()

    def _number(self, identity: VehicleId) -> int:
        """Return the number of a vehicle's link in use."""
        links = self.station.vehicles[identity].links
        return 1 if links is None else links.in_use.number
