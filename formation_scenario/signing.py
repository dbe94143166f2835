"""Keys of signed links: which key file, and what becomes of frames without a signature."""

from __future__ import annotations

from collections.abc import Iterator
from pathlib import Path
from typing import Final, Literal

from airlink.signing.key import ALLOWED, KeyFileError, read_key
from formation_scenario.fields import Keys, Text, key
from formation_scenario.source import Finding, KeyPath

NOT_SIGNED: Final = "none"
"""In place of a key file: a vehicle's link without a key, where the others have one."""


class Signing(Keys):
    """MAVLink 2 signing of a link, at both ends."""

    key_file: Text = key(
        ...,
        "file of mode 0600 with the key: 32 bytes in hex, or a passphrase as MAVProxy's `signing setup` takes it; "
        "relative to the scenario's file; none: not signed",
        "link.key",
    )
    unsigned: Literal["refuse", "accept"] = key(
        "refuse",
        "what becomes of frames without a signature; wrongly signed ones are refused in any case, and those of a "
        "telemetry radio itself (RADIO_STATUS) are taken",
        "accept",
    )

    @property
    def file(self) -> Path | None:
        """The key file; None if nothing is signed."""
        return None if self.key_file == NOT_SIGNED else Path(self.key_file)


def unreadable(signing: Signing | None, path: KeyPath, known: dict[Path, str | None]) -> Iterator[Finding]:
    """Yield a key file that can't be used; `known`: what was found of those that were looked at before."""
    file = None if signing is None else signing.file
    if file is None:
        return
    if file not in known:
        known[file] = _problem(file)
    problem = known[file]
    if problem is not None:
        yield (*path, "signing", "key_file"), problem, ALLOWED


def _problem(file: Path) -> str | None:
    try:
        read_key(file)
    except KeyFileError as error:
        return str(error)
    return None
