"""Where autopilots keep their logs, as MAVLink FTP lists them.

Sources: ArduPilot's `HAL_BOARD_LOG_DIRECTORY` (APM/LOGS on boards, logs in its simulator); PX4's
src/modules/mavlink/mavlink_ftp.cpp (@MAV_LOG since version 1.18; /fs/microsd/log on boards, log in its simulator) and
src/modules/logger: a folder for each day, or for each boot where the time isn't known, with files named by the time of
day or by a number.
"""

from __future__ import annotations

import re
from collections.abc import Sequence
from typing import Final, NamedTuple


class Layout(NamedTuple):
    """Where a family keeps them."""

    roots: tuple[str, ...]
    log: re.Pattern[str]
    """A log in a folder's listing, with the parts of its number, then its size."""
    inner: re.Pattern[str] | None = None
    """A folder of logs in a listing; None: logs lie in the root."""


ARDUPILOT: Final = Layout(("APM/LOGS", "logs"), re.compile(r"F(?P<name>0*(?P<number>\d+)\.bin)\t(?P<size>\d+)", re.I))
PX4: Final = Layout(
    ("@MAV_LOG", "/fs/microsd/log", "log"),
    re.compile(r"F(?P<name>(?:log)?(?P<number>[\d_]+)\.ulg)\t(?P<size>\d+)"),
    re.compile(r"D(\d{4}-\d\d-\d\d|sess\d+)"),
)


class LogFolders:
    """The folders of one vehicle, listed one after another, and its logs in the one that is listed."""

    def __init__(self, layout: Layout) -> None:
        """Begin with the first root."""
        self._layout, self._root = layout, 0
        self.path = layout.roots[0]
        """The folder to list."""
        self.seen = 0
        """Entries of it that have been listed."""
        self.sizes: dict[int, int] = {}
        """Bytes of its logs by their numbers: the time of day as hhmmss, or the number in the file's name."""
        self._names = dict[int, str]()
        self._inner = set[str]()

    def add(self, entries: Sequence[str]) -> None:
        """Take entries of the folder's listing: a letter for its kind, its name, and of a file a tab and its size."""
        self.seen += len(entries)
        inner = self._layout.inner
        for each in entries:
            if (log := self._layout.log.fullmatch(each)) is not None:
                number = int(log["number"].replace("_", ""))
                self._names[number], self.sizes[number] = log["name"], int(log["size"])
            elif inner is not None and (folder := inner.fullmatch(each)) is not None:
                self._inner.add(folder[1])

    def descends(self) -> bool:
        """Go into the newest folder of those listed; return whether there is one. Days are newer than boots."""
        if not self._inner:
            return False
        self._list(f"{self.path}/{max(self._inner, key=lambda name: (name[0].isdigit(), name))}")
        return True

    def goes_on(self) -> bool:
        """Go on to the next root; return whether there is one."""
        if self._root + 1 >= len(self._layout.roots):
            return False
        self._root += 1
        self._list(self._layout.roots[self._root])
        return True

    def file(self, number: int) -> str:
        """Return the path of a log."""
        return f"{self.path}/{self._names[number]}"

    def _list(self, path: str) -> None:
        self.path, self.seen = path, 0
        self._inner.clear()
