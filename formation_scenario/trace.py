"""Recorded delays: a text file with a number of milliseconds on each line."""

from __future__ import annotations

import re
from pathlib import Path

MOST_MS = 600_000.0
ALLOWED = f"a file with a number of milliseconds from 0 to {MOST_MS:.0f} on each line, # before comments"
_NUMBER = re.compile(r"^[-+]?(\d+\.?\d*|\.\d+)([eE][-+]?\d+)?$")


class TraceError(Exception):
    """A file that isn't a list of recorded delays; the message says what was found, and on which line."""


def read_trace_ms(path: Path) -> tuple[float, ...]:
    """Return the delays of a file in ms, in its order; empty lines and what follows a # are left out.

    Raises:
        TraceError: the file can't be read, has no number, or a line that isn't a number from 0 to `MOST_MS`.
    """
    try:
        text = path.read_text(encoding="utf-8")
    except OSError as error:
        raise TraceError(f"found {path}: {error.strerror}") from error
    except UnicodeDecodeError as error:
        raise TraceError(f"found {path}, which isn't text in UTF-8") from error
    lines = ((number, line.partition("#")[0].strip()) for number, line in enumerate(text.splitlines(), start=1))
    delays_ms = tuple(_delay_ms(entry, f"{path}:{number}") for number, entry in lines if entry)
    if not delays_ms:
        raise TraceError(f"found {path} without a number in it")
    return delays_ms


def _delay_ms(entry: str, place: str) -> float:
    if not _NUMBER.match(entry) or not 0.0 <= float(entry) <= MOST_MS:
        raise TraceError(f"found '{entry[:40]}' at {place}")
    return float(entry)
