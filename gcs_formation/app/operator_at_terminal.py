"""The operator at the terminal: options of a flight, interrupts, and confirmation that vehicles may be armed."""

from __future__ import annotations

import os
import select
import signal
import sys
from collections.abc import Callable
from dataclasses import dataclass
from numbers import Real
from pathlib import Path
from types import FrameType
from typing import TYPE_CHECKING, Any, Literal, Self, get_args

from airlink.cli import counted
from airlink.clock import Instant
from airlink.forwarding import Forward
from formation_scenario.expectation import Expectation
from gcs_formation.recorder import Event, Recorder

if TYPE_CHECKING:
    from gcs_formation.mission.gate import Gate
    from gcs_formation.mission.phase_machine import FlightPhaseMachine

ClockName = Literal["real", "virtual"]
Record = Literal["full", "series", "summary", "none"]
"""What is kept of a flight: everything, all but the frames, only the summary, nothing."""
SIGNALS = (signal.SIGINT, signal.SIGTERM, signal.SIGHUP)
"""SIGHUP: the terminal was closed, or the connection to it was lost."""
YES = ("y", "yes")
MAX_BYTES = 1000
DECLINED = "not confirmed: no vehicle was commanded"


@dataclass(frozen=True)
class RunOptions:
    """Options of `run` and `fly`.

    Raises:
        ValueError: a value that isn't allowed.
    """

    out: Path
    clock: ClockName = "real"
    speedup: float = 1.0
    until_s: float | None = None
    overwrite: bool = False
    """Whether an earlier run in `out` may be replaced."""
    record: Record = "full"
    """What is written to `out`; the summary is returned in any case."""
    measure: tuple[Expectation, ...] = ()
    """Further figures over windows of time for the summary; their bounds aren't judged."""
    confirm: bool = False
    """`fly` only: whether the operator must confirm before any vehicle is commanded."""
    dry_run: bool = False
    """`fly` only: whether the run ends before the first command."""
    resume: bool = False
    """`fly` only: whether the unfinished run in `out` is continued."""
    set_parameters: bool = False
    """`fly` only: whether parameters are set that aren't as the check asks for, and restored after the flight."""
    take: bool = False
    """`fly` only: whether vehicles are taken over too that fly under somebody else's command."""
    forward: tuple[Forward, ...] = ()
    """Second ground stations that see the vehicles, and may command them; under the real clock alone."""
    recording: Callable[[], None] | None = None
    """Called when the record is open; with it, the record is written at every tick, since somebody may look on."""

    def __post_init__(self) -> None:
        """Refuse values that the command line refuses as well."""
        if self.clock not in get_args(ClockName):
            raise ValueError(f"clock: found {self.clock!r}; allowed: {', '.join(get_args(ClockName))}")
        if not _is_number(self.speedup, 0.01, 1000.0):
            raise ValueError(f"speedup: found {self.speedup!r}; allowed: a number from 0.01 to 1000")
        if self.clock == "virtual" and self.speedup != 1.0:
            found = f"found {self.speedup:g} under the virtual clock, which is as fast as the processor allows"
            raise ValueError(f"speedup: {found}; allowed: none, or the real clock")
        if self.clock == "virtual" and self.forward:
            found = f"found {self.forward[0].endpoint} under the virtual clock, which has no other programs"
            raise ValueError(f"forward: {found}; allowed: none, or the real clock")
        if self.until_s is not None and not _is_number(self.until_s, 0.0, sys.float_info.max):
            raise ValueError(f"until: found {self.until_s!r}; allowed: a number >= 0")


def _is_number(found: object, minimum: float, maximum: float) -> bool:
    """Return whether what a script gave is a number within bounds."""
    return isinstance(found, Real) and minimum <= float(found) <= maximum


class Interrupts:
    """While entered, counts termination signals instead of being terminated by them.

    Each signal takes the flight one step further to its end. First: the formation spreads out and loiters. Second: all
    vehicles return home at once. Third: the run ends without waiting for vehicles.
    """

    def __init__(self) -> None:
        self.count = 0
        self._processed, self._left = 0, False
        self._before: dict[signal.Signals, Any] = {}

    def __enter__(self) -> Self:
        """Install the handlers, unless this isn't the main thread. Under nohup, SIGHUP stays ignored."""
        nohup = signal.getsignal(signal.SIGHUP) is signal.SIG_IGN
        taken = [number for number in SIGNALS if not (nohup and number is signal.SIGHUP)]
        try:
            self._before = {number: signal.signal(number, self._count_signal) for number in taken}
        except ValueError:
            self._before = {}
        return self

    def __exit__(self, *_: object) -> None:
        for number, handler in self._before.items():
            signal.signal(number, handler)

    def _count_signal(self, number: int, _frame: FrameType | None) -> None:
        # Both the shell and the kernel signal a closed terminal: that isn't a second request.
        self.count = max(self.count, 1) if number == signal.SIGHUP else self.count + 1

    def process(self, phase_machine: FlightPhaseMachine, now: Instant) -> bool:
        """Do what the interrupts so far ask for; return whether the run ends without waiting for vehicles."""
        while self._processed < self.count:
            self._processed += 1
            if self._processed == 1:
                phase_machine.stop(now)
            elif self._processed > 2 or not phase_machine.go_home_at_once(now):
                self._left = True
        return self._left


class Confirmation:
    """Asks the operator when it is time to, and passes the answer on."""

    def __init__(self, gate: Gate, recorder: Recorder, terminal: int, decline: Callable[[str], None]) -> None:
        """Ask for `gate` on the file descriptor of a terminal; `decline` ends the run with the reason."""
        self._gate, self._recorder = gate, recorder
        self._terminal, self._decline = terminal, decline
        self._asked = self._answered = False
        self._typed = b""

    def poll(self, now: Instant) -> None:
        """Ask, or look for an answer."""
        if self._answered:
            return
        if self._gate.awaits_word and not self._asked:
            self._asked = True
            while _is_ready(self._terminal) and os.read(self._terminal, MAX_BYTES):
                pass  # what was typed before the question
            self._recorder.event(Event(now, "confirm", question(self._gate)))
        if self._asked and _is_ready(self._terminal):
            read = os.read(self._terminal, MAX_BYTES)
            self._typed = (self._typed + read)[:MAX_BYTES]
            if b"\n" in self._typed or not read:
                self._answer(self._typed.partition(b"\n")[0].decode(errors="replace").strip().lower(), now)

    def _answer(self, word: str, now: Instant) -> None:
        self._answered = True
        self._recorder.event(Event(now, "confirm", "yes" if word in YES else "no"))
        if word in YES:
            self._gate.confirm()
        else:
            self._decline(DECLINED)


def question(gate: Gate) -> str:
    """Return what to ask once a gate awaits the operator's word."""
    count, flying = len(gate.vehicles), sum(vehicle.airborne for vehicle in gate.vehicles.values())
    are = f"{counted(count, 'vehicle')} {'is' if count == 1 else 'are'}"
    state = f"{are} connected, ready and checked ({sum(map(bool, gate.warnings.values()))} with warnings)"
    what = f"arm {count - flying} and take off" + (f", take over {flying}" if flying else "")
    others = ", ".join(f"vehicle {vehicle.identity} from {mode}" for vehicle, mode in gate.flown_by_others)
    what += f" ({others}, under somebody's command)" if others else ""
    return f"{state}. Type yes to {what}; anything else ends the run"


def _is_ready(terminal: int) -> bool:
    return bool(select.select([terminal], [], [], 0.0)[0])
