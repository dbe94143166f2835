"""How long something has come again and again."""

from __future__ import annotations

from airlink.clock import Instant, seconds_between


class UnbrokenRun:
    """Since when something has come repeatedly, without a gap longer than a limit."""

    def __init__(self) -> None:
        """Start with nothing come."""
        self._since: Instant | None = None
        self._last = Instant(0)
        self._gap_s = 0.0

    def note(self, now: Instant) -> None:
        """Take one that has come now."""
        if self._since is None or seconds_between(self._last, now) > self._gap_s:
            self._since = now
        self._last = now

    def since(self, now: Instant, gap_s: float) -> Instant | None:
        """Return when the run that goes on now began, or None. `gap_s`, the longest gap, applies from then on."""
        self._gap_s = gap_s
        return None if seconds_between(self._last, now) > gap_s else self._since
