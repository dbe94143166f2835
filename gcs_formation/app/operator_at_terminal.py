"""The operator at the terminal: interrupts, and confirmation that vehicles may be armed."""

from __future__ import annotations

import os
import select
import signal
from collections.abc import Callable
from types import FrameType
from typing import TYPE_CHECKING, Any, Self

from airlink.cli import counted
from airlink.clock import Instant
from gcs_formation.recorder import Event, Recorder

if TYPE_CHECKING:
    from gcs_formation.mission.gate import Gate
    from gcs_formation.mission.phase_machine import FlightPhaseMachine

SIGNALS = (signal.SIGINT, signal.SIGTERM, signal.SIGHUP)
"""SIGHUP: the terminal was closed, or the connection to it was lost."""
YES = ("y", "yes")
MAX_BYTES = 1000
DECLINED = "not confirmed: no vehicle was commanded"


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
