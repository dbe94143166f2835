"""A flight that stops after every control tick, for a program that steps it."""

from __future__ import annotations

import asyncio
import signal
import threading
from collections import deque
from collections.abc import Callable, Mapping
from contextlib import AbstractContextManager, ExitStack
from functools import partial
from pathlib import Path
from types import FrameType
from typing import NamedTuple, Protocol, TypeVar

from airlink.cli import rare_garbage_collection
from airlink.clock import Instant
from formation_scenario import Scenario
from gcs_formation.app.operator_at_terminal import Interrupts
from gcs_formation.app.progress import Progress
from gcs_formation.app.run import Run, closed_if_it_raises, conclude, in_memory, over_udp
from gcs_formation.app.run_options import RunOptions
from gcs_formation.app.session import Session
from gcs_formation.phases import OVER
from gcs_formation.record.summary import Summary
from gcs_formation.recorder import Event, Tick
from gcs_formation.station import Station

Result = TypeVar("Result")
Opens = Callable[[Scenario, RunOptions, Progress, Interrupts], AbstractContextManager[tuple[Session, Run]]]
"""Begins a flight, and says what runs it."""
WAIT_S = 0.5
"""How long the program's thread sleeps at most, so that Ctrl-C reaches it."""


class Stop(NamedTuple):
    """Where a flight stopped: the newest tick, its number, and the events since the last stop."""

    tick: Tick
    number: int
    events: list[Event]
    ends: bool
    """Whether the flight along the path is over, so that vehicles are brought to their end."""


class Stepped(Protocol):
    """A flight that a program steps."""

    session: Session

    def next(self) -> Stop | None:
        """Fly to the next control tick; return None when the flight is over."""
        ...

    def do(self, what: Callable[[Instant], Result]) -> Result:
        """Call a function between two events of the flight, with its instant; return or raise what it does."""
        ...

    def finish(self) -> Summary:
        """Fly on to the flight's end, close the record, and return the summary.

        Raises:
            RunAbortedError: the flight couldn't go on.
            KeyboardInterrupt: by a signal.
        """
        ...


class _EventQueue(Progress):
    """Keeps events until the program takes them."""

    def __init__(self) -> None:
        super().__init__()
        self.events: list[Event] = []

    def show_event(self, event: Event, mission_s: float) -> None:  # noqa: ARG002 - as `Progress` has it
        """Keep an event."""
        self.events.append(event)

    def taken(self) -> list[Event]:
        """Return the events since the last call."""
        taken, self.events = self.events, []
        return taken


class _Signals(Interrupts):
    """Counts signals while the flight flies; while the program has the word they do what they did before."""

    def __init__(self) -> None:
        super().__init__()
        self.flies = False

    def _count_signal(self, number: int, frame: FrameType | None) -> None:
        before = None if self.flies else self._before.get(signal.Signals(number))
        if callable(before):
            before(number, frame)
        else:
            super()._count_signal(number, frame)


class VirtualSteps:
    """Under the virtual clock the flight waits for the program, whose orders come between the same events each time."""

    def __init__(self, scenario: Scenario, options: RunOptions, programs: Mapping[str, Path] | None = None) -> None:
        """Begin the flight; nothing happens before the first step. `programs`: of simulators, by family."""
        self._events, self._signals, self._open = _EventQueue(), _Signals(), ExitStack()
        opens = _with_simulators(programs) if programs else in_memory
        opened = opens(scenario, options, self._events, self._signals)
        self.session, self._run_until = self._open.enter_context(opened)
        self._signals.__enter__()
        station = self.session.station
        self._last = 0

        def stops() -> bool:
            return self.session.attend() or station.recorded_ticks > self._last

        self._stops = stops

    def next(self) -> Stop | None:
        """Fly to the next control tick; return None when the flight is over."""
        station = self.session.station
        last = self._last = station.recorded_ticks
        self._signals.flies = True
        with rare_garbage_collection():
            self._run_until(self._stops)
        self._signals.flies = False
        if self._signals.count:
            raise KeyboardInterrupt
        if station.recorded_ticks == last or station.newest is None:
            return None
        return Stop(station.newest, station.recorded_ticks, self._events.taken(), _ends(station))

    def do(self, what: Callable[[Instant], Result]) -> Result:
        """Call a function with the present instant."""
        return what(self.session.clock.now())

    def finish(self) -> Summary:
        """Fly on to the flight's end, and return the summary."""
        stopped, self._signals.flies = self._signals.count, True
        try:
            with rare_garbage_collection(), closed_if_it_raises(self.session):
                self._run_until(self.session.attend)
                self._open.close()
                summary = conclude(self.session)
        finally:
            self._open.close()
            self._signals.__exit__()
        if self._signals.count > stopped:
            raise KeyboardInterrupt
        return summary


def _with_simulators(programs: Mapping[str, Path]) -> Opens:
    from gcs_formation.app.sitl.stepped.flight import in_step  # noqa: PLC0415 - only with programs any are started

    return partial(in_step, programs)


def _ends(station: Station) -> bool:
    return station.flight.phase in OVER or station.flight.ended


class _Call:
    """A function for the flight's thread to call."""

    def __init__(self, what: Callable[[Instant], None]) -> None:
        self.what = what
        self.done = threading.Event()


class RealSteps:
    """Under the real clock the flight goes on in a thread of its own, and a step waits for a tick that is new."""

    def __init__(self, scenario: Scenario, options: RunOptions) -> None:
        """Begin the flight."""
        self._events, self._interrupts, self._open = _EventQueue(), Interrupts(), ExitStack()
        opened = over_udp(scenario, options, self._events, self._interrupts)
        self.session, self._run_until, self._is_over = self._open.enter_context(opened)
        self._changed = threading.Condition()
        self._calls = deque[_Call]()
        self._stop: Stop | None = None
        self._given, self._ended = 0, False
        self._failed: BaseException | None = None
        self._thread = threading.Thread(target=self._fly, name="gcs-formation flight", daemon=True)
        self._thread.start()

    def next(self) -> Stop | None:
        """Wait for a tick that wasn't given yet; return the newest, or None when the flight is over or has failed."""
        with self._changed:
            while self._stop is None and not self._ended:
                self._changed.wait(WAIT_S)
            stop, self._stop = self._stop, None
        return stop

    def do(self, what: Callable[[Instant], Result]) -> Result:
        """Have the flight's thread call a function between two events."""
        results, errors = list[Result](), list[BaseException]()

        def call(now: Instant) -> None:
            try:
                results.append(what(now))
            except (ValueError, LookupError) as error:
                errors.append(error)

        asked = _Call(call)
        with self._changed:
            if not self._ended:
                self._calls.append(asked)
        while not (asked.done.wait(WAIT_S) or self._ended):
            pass
        if errors:
            raise errors[0]
        return results[0] if results else what(self.session.clock.now())

    def finish(self) -> Summary:
        """Wait for the flight's end, and return the summary."""
        with self._interrupts:
            while self._thread.is_alive():
                self._thread.join(WAIT_S)
            self._open.close()
            if self._failed is not None:
                raise self._failed
            summary = conclude(self.session)
        if self._interrupts.count:
            raise KeyboardInterrupt
        return summary

    def _fly(self) -> None:
        try:
            self._run_until(self._attend)
        except BaseException as error:  # noqa: BLE001 - raised again in the program's thread
            self._failed = error
        with self._changed:
            self._ended = True
            self._changed.notify_all()

    def _attend(self) -> bool:
        while self._calls:
            asked = self._calls.popleft()
            asked.what(self.session.clock.now())
            asked.done.set()
        over, station = self._is_over(), self.session.station
        if station.recorded_ticks > self._given and station.newest is not None:
            self._given = station.recorded_ticks
            with self._changed:
                earlier = [] if self._stop is None else self._stop.events
                self._stop = Stop(station.newest, self._given, [*earlier, *self._events.taken()], _ends(station))
                self._changed.notify_all()
        return over


async def asynchronously(what: Callable[[], Result]) -> Result:
    """Call a function in a thread, while other tasks go on."""
    return await asyncio.to_thread(what)


def programs_given(sitl: Mapping[str, str | Path]) -> dict[str, Path]:
    """Return the programs of simulators at paths, by family.

    Raises:
        ValueError: there is no such family, or no such program.
    """
    from gcs_formation.app.sitl.fleet import programs_at  # noqa: PLC0415 - only with `sitl` any are started

    return programs_at(sitl)


def stepped(scenario: Scenario, options: RunOptions, programs: Mapping[str, Path] | None = None) -> Stepped:
    """Begin a flight that a program steps; `programs`: of simulators that are stepped with it, by family.

    Raises:
        ScenarioError: a vehicle can't be simulated by these programs.
        RunAbortedError: a port is taken, a simulator can't be started.
        RecordError: the run directory can't be written.
    """
    return VirtualSteps(scenario, options, programs) if options.clock == "virtual" else RealSteps(scenario, options)
