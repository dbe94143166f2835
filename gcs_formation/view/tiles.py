"""A map beneath the plan: tiles that the browser fetches from a server of the user's choice, with the user's key.

Off unless an address is given; nothing is fetched from anywhere then. Tiles are those of the web Mercator projection as
all tile servers number them (zoom, x from 180 degrees west, y from 85.05 degrees north).
"""

from __future__ import annotations

from typing import NamedTuple, Self
from urllib.parse import urlsplit

from gcs_formation.view.access import is_loopback

NEEDED = ("{z}", "{x}", "{y}")
ALLOWED = "allowed: https://HOST/…{z}…{x}…{y}…, with the key of the map's service where it wants it"
MAX_LETTERS = 500


class TileError(ValueError):
    """An address that isn't one of tiles."""


class Tiles(NamedTuple):
    """Where tiles come from."""

    address: str
    """With `{z}`, `{x}` and `{y}` in place of a tile's numbers."""
    origin: str
    """Scheme, host and port: the only place beside this server that the page may take images from."""

    @classmethod
    def at(cls, address: str) -> Self:
        """Return the tiles of an address.

        Raises:
            TileError: it lacks a number's place, isn't https, or has a host that can't be named in a policy.
        """
        if len(address) > MAX_LETTERS or any(name not in address for name in NEEDED):
            raise TileError(f"found '{address[:MAX_LETTERS]}'; {ALLOWED}")
        try:
            parts = urlsplit(address)
            host, port = parts.hostname or "", parts.port
        except ValueError as error:
            raise TileError(f"found '{address}', {error}; {ALLOWED}") from error
        named = host.isascii() and bool(host) and all(letter.isalnum() or letter in ".-" for letter in host)
        safe = parts.scheme == "https" or (parts.scheme == "http" and is_loopback(host))
        if not named or not safe or parts.username is not None:
            raise TileError(f"found '{address}'; {ALLOWED}")
        return cls(address, f"{parts.scheme}://{host}" + (f":{port}" if port is not None else ""))
