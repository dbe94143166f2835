"""How far a study is: a line that is rewritten on a terminal, one for each tenth in a pipe."""

from __future__ import annotations

import sys
from types import TracebackType
from typing import Self

import click
from rich.console import Console
from rich.live import Live
from rich.text import Text

from airlink.clock import Stopwatch

TENTHS = 10
SHOWN_EVERY_S = 0.5


class StudyProgress:
    """Shows flights done, their rate, the time that is left, and failures."""

    def __init__(self, *, quiet: bool) -> None:
        """Show nothing if `quiet`."""
        self._quiet = quiet
        self._live = (
            Live(console=Console(stderr=True), transient=True, auto_refresh=False) if _terminal(quiet) else None
        )
        self._spent, self._shown_s = Stopwatch(), 0.0
        self._first: int | None = None
        self._tenths = 0

    def __enter__(self) -> Self:
        """Begin."""
        if self._live is not None:
            self._live.start()
        return self

    def __exit__(
        self, kind: type[BaseException] | None, error: BaseException | None, trace: TracebackType | None
    ) -> None:
        """Remove the line."""
        if self._live is not None:
            self._live.stop()

    def say(self, text: str) -> None:
        """Show a line that stays, unless it is empty."""
        if text and not self._quiet:
            click.echo(text, err=True)

    def show(self, done: int, total: int, failed: int) -> None:
        """Show it; `total` is how many flights there are at most."""
        spent_s = self._spent.wall_s
        self._first = done - 1 if self._first is None else self._first
        text = progress_text(done, total, failed, (done - self._first) / max(spent_s, 1e-6))
        if self._live is not None and (spent_s - self._shown_s > SHOWN_EVERY_S or done == total):
            self._shown_s = spent_s
            self._live.update(Text(text, no_wrap=True, overflow="ellipsis"), refresh=True)
        elif self._live is None and not self._quiet and done * TENTHS // total > self._tenths:
            self._tenths = done * TENTHS // total
            click.echo(text, err=True)


def progress_text(done: int, total: int, failed: int, rate_hz: float) -> str:
    """Return the progress in words."""
    left_s = (total - done) / rate_hz
    failures = f"  {failed} failed" if failed else ""
    return f"{done} of {total} flights  {rate_hz:.2g}/s  {_time(left_s)} left{failures}"


def _time(seconds: float) -> str:
    minutes, rest = divmod(round(seconds), 60)
    hours, minutes = divmod(minutes, 60)
    if hours:
        return f"{hours} h {minutes:02d} min"
    return f"{minutes} min {rest:02d} s" if minutes else f"{rest} s"


def _terminal(quiet: bool) -> bool:
    return sys.stderr.isatty() and not quiet
