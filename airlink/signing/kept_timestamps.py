"""A key's timestamps in a file beside its own, so that what was recorded before a restart stays old after it."""

from __future__ import annotations

import json
import os
from pathlib import Path
from typing import Final

from airlink.clock import Instant, after
from airlink.signing.authentication import Authentication, Stream
from airlink.signing.key import MODE, KeyFileError, SigningKey
from airlink.signing.signature import MAX_TIMESTAMP

SUFFIX: Final = ".timestamps"
EVERY_S: Final = 10.0
MAX_BYTES: Final = 1_000_000
SCHEMA: Final = 1


class KeptTimestamps:
    """Keeps one key's timestamps: the newest of all, and of each stream."""

    def __init__(self, key_file: Path) -> None:
        """Keep them beside a key file."""
        self.path = key_file.with_name(f"{key_file.name}{SUFFIX}")
        self._next = Instant(0)

    def restored(self, key: SigningKey, utc_at_0_us: int) -> Authentication:
        """Return the state of a key as it was when it was kept last.

        Raises:
            KeyFileError: the file is there and can't be read: without it, old frames could be new.
        """
        timestamp, streams = self._read()
        return Authentication(key, utc_at_0_us, timestamp, streams)

    def keep_in_time(self, authentication: Authentication, now: Instant) -> None:
        """Keep them if that wasn't done for `EVERY_S`.

        Raises:
            KeyFileError: as `keep`.
        """
        if now >= self._next:
            self._next = after(now, EVERY_S)
            self.keep(authentication)

    def keep(self, authentication: Authentication) -> None:
        """Write the file; what another program with the same key has kept meanwhile is kept, where it is newer.

        Raises:
            KeyFileError: it can't be written.
        """
        timestamp, streams = self._read()
        for stream, newest in authentication.streams.items():
            streams[stream] = max(newest, streams.get(stream, 0))
        named = {"/".join(map(str, stream)): newest for stream, newest in sorted(streams.items())}
        data = {"schema": SCHEMA, "timestamp": max(timestamp, authentication.timestamp), "streams": named}
        temporary = self.path.with_name(f"{self.path.name}.{os.getpid()}")
        try:
            handle = os.open(temporary, os.O_WRONLY | os.O_CREAT | os.O_TRUNC, MODE)
            with os.fdopen(handle, "w", encoding="ascii") as file:
                json.dump(data, file)
            temporary.replace(self.path)
        except OSError as error:
            raise KeyFileError(
                f"cannot write {self.path}, which keeps timestamps: {error.strerror or error}"
            ) from error

    def _read(self) -> tuple[int, dict[Stream, int]]:
        try:
            with self.path.open("rb") as file:
                data = json.loads(file.read(MAX_BYTES))
            streams = {_stream(name): _timestamp(newest) for name, newest in data["streams"].items()}
            return _timestamp(data["timestamp"]), streams
        except FileNotFoundError:
            return 0, {}
        except OSError as error:
            raise KeyFileError(f"cannot read {self.path}, which keeps timestamps: {error.strerror or error}") from error
        except (ValueError, KeyError, TypeError, AttributeError) as error:
            raise KeyFileError(
                f"found {self.path} without timestamps in it; allowed: as it was written, or no such file"
            ) from error


def _stream(name: str) -> Stream:
    system, component, link_id = (int(each) for each in name.split("/"))
    return system, component, link_id


def _timestamp(value: object) -> int:
    if not isinstance(value, int) or not 0 <= value <= MAX_TIMESTAMP:
        raise ValueError(value)
    return value
