"""Asks on the terminal whether vehicles that are connected and checked may be armed; never blocks."""

from __future__ import annotations

import os
import select
from collections.abc import Callable
from typing import Protocol

from airlink.clock import Instant
from gcs_formation.recorder import Event, Recorder

YES = ("y", "yes")
MOST_BYTES = 1000
DECLINED = "not confirmed: nobody was commanded"


class Gate(Protocol):
    """What waits for the word: a `PreFlight`."""

    @property
    def awaits_word(self) -> bool:
        """Whether the question is due."""
        ...

    def question(self) -> str:
        """Return it."""
        ...

    def confirm(self) -> None:
        """Take the answer yes."""
        ...


class Confirmation:
    """Puts the question when it is due, and passes the answer on."""

    def __init__(self, gate: Gate, recorder: Recorder, terminal: int, decline: Callable[[str], None]) -> None:
        """Ask for `gate` on the file descriptor of a terminal; `decline` ends the run with the reason."""
        self._gate, self._recorder = gate, recorder
        self._terminal, self._decline = terminal, decline
        self._asked = self._answered = False
        self._typed = b""

    def poll(self, now: Instant) -> None:
        """Ask, or look for the answer."""
        if self._answered:
            return
        if self._gate.awaits_word and not self._asked:
            self._asked = True
            _discard(self._terminal)
            self._recorder.event(Event(now, "confirm", self._gate.question()))
        if self._asked and _is_ready(self._terminal):
            read = os.read(self._terminal, MOST_BYTES)
            self._typed = (self._typed + read)[:MOST_BYTES]
            if b"\n" in self._typed or not read:
                self._answer(self._typed.partition(b"\n")[0].decode(errors="replace").strip().lower(), now)

    def _answer(self, word: str, now: Instant) -> None:
        self._answered = True
        self._recorder.event(Event(now, "confirm", "yes" if word in YES else "no"))
        if word in YES:
            self._gate.confirm()
        else:
            self._decline(DECLINED)


def _is_ready(terminal: int) -> bool:
    return bool(select.select([terminal], [], [], 0.0)[0])


def _discard(terminal: int) -> None:
    """Forget what was typed before the question."""
    while _is_ready(terminal) and os.read(terminal, MOST_BYTES):
        pass
