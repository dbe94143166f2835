"""A link's key, from a file that no other user can read."""

from __future__ import annotations

import hashlib
import os
import re
import secrets
import stat
from pathlib import Path
from typing import Final

from airlink.endpoint import AirlinkError

KEY_BYTES: Final = 32
MAX_BYTES: Final = 4096
MODE: Final = 0o600
_HEX: Final = re.compile(rf"[0-9A-Fa-f]{{{2 * KEY_BYTES}}}")
ALLOWED: Final = (
    f"a file of mode 0600 with {KEY_BYTES} bytes in hex, or a passphrase as MAVProxy's `signing setup` takes it "
    "(`gcs-formation signing key FILE` writes a new one)"
)


class KeyFileError(AirlinkError):
    """A key file that can't be used; the message says what was found, never what is in it."""


class SigningKey:
    """A secret key; its text doesn't show it. Immutable."""

    __slots__ = ("octets",)

    def __init__(self, octets: bytes) -> None:
        """Take 32 bytes."""
        self.octets = octets

    def __repr__(self) -> str:
        """Return a text without the key."""
        return "SigningKey(…)"

    def __eq__(self, other: object) -> bool:
        """Return whether both are the same key."""
        return isinstance(other, SigningKey) and self.octets == other.octets

    def __hash__(self) -> int:
        """Return a hash."""
        return hash(self.octets)


def key_of_passphrase(passphrase: str) -> SigningKey:
    """Return the key of a passphrase, as MAVProxy and Mission Planner have it: its SHA-256."""
    return SigningKey(hashlib.sha256(passphrase.encode()).digest())


def read_key(path: Path) -> SigningKey:
    """Return the key in a file: 64 hexadecimal digits are the key itself, any other line is a passphrase.

    Raises:
        KeyFileError: there is no such file, others may read it, or it holds neither.
    """
    try:
        text = _read(path)
    except OSError as error:
        raise KeyFileError(f"found {path}: {error.strerror or error}") from error
    except UnicodeDecodeError as error:
        raise KeyFileError(f"found {path}, which isn't text in UTF-8") from error
    lines = text.strip().splitlines()
    if len(lines) != 1:
        raise KeyFileError(f"found {path} with {len(lines)} lines")
    word = lines[0].strip()
    if not _HEX.fullmatch(word):
        return key_of_passphrase(word)
    octets = bytes.fromhex(word)
    if not any(octets):
        raise KeyFileError(f"found {path} with a key of zeros, which means that nothing is signed")
    return SigningKey(octets)


def write_new_key(path: Path) -> None:
    """Write a random key into a file that wasn't there.

    Raises:
        KeyFileError: it is there, or can't be written.
    """
    try:
        handle = os.open(path, os.O_WRONLY | os.O_CREAT | os.O_EXCL, MODE)
        with os.fdopen(handle, "w", encoding="ascii") as file:
            file.write(f"{secrets.token_hex(KEY_BYTES)}\n")
    except OSError as error:
        raise KeyFileError(f"cannot write {path}: {error.strerror or error}") from error


def _read(path: Path) -> str:
    handle = os.open(path, os.O_RDONLY | os.O_NONBLOCK)
    with os.fdopen(handle, "rb") as file:
        found = os.fstat(handle)
        if not stat.S_ISREG(found.st_mode):
            raise KeyFileError(f"found {path}, which isn't a file")
        if stat.S_IMODE(found.st_mode) & ~MODE:
            raise KeyFileError(f"found {path} with mode {stat.S_IMODE(found.st_mode):04o}, which others may use")
        data = file.read(MAX_BYTES + 1)
        if len(data) > MAX_BYTES:
            raise KeyFileError(f"found {path}, which is longer than {MAX_BYTES} bytes")
        return data.decode()
