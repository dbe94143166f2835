"""Who may use the page: the checks of every request, before anything else is looked at.

On the loopback interface, any user of the machine; the Host header must name it, so that a page of another site can't
reach it under a name of its own (DNS rebinding). On another interface, any client that has the token that the printed
address holds; orders are off there unless they are asked for. What changes anything must come from the page itself
(Origin).
"""

from __future__ import annotations

import hmac
import ipaddress
import secrets
from dataclasses import dataclass, field
from urllib.parse import parse_qs, urlsplit

from airlink.endpoint import Address

COOKIE = "gcs_formation_token"
LOOPBACK_NAMES = ("localhost", "127.0.0.1", "::1")
READING = ("GET", "HEAD")


def is_loopback(host: str) -> bool:
    """Return whether an address is this machine's own."""
    try:
        return ipaddress.ip_address(host).is_loopback
    except ValueError:
        return host == "localhost"


@dataclass(frozen=True)
class Access:
    """Where the page is served, and to whom."""

    address: Address
    orders: bool
    """Whether orders are taken."""
    token: str = field(default_factory=lambda: secrets.token_urlsafe(24))

    @property
    def is_open(self) -> bool:
        """Whether no token is needed."""
        return is_loopback(self.address.host)

    @property
    def url(self) -> str:
        """What to open in a browser."""
        host = f"[{self.address.host}]" if ":" in self.address.host else self.address.host
        return f"http://{host}:{self.address.port}/" + ("" if self.is_open else f"?token={self.token}")

    def refusal(self, method: str, headers: dict[str, str], query: str) -> tuple[int, str] | None:
        """Return the status and the reason with which a request is refused; None if it is allowed."""
        host = headers.get("host", "")
        if not self._is_own(host):
            return 403, "found a Host that isn't this server; allowed: the address that was printed"
        origin = headers.get("origin")
        if origin is not None and urlsplit(origin).netloc.lower() != host.lower():
            return 403, "found another site's Origin; allowed: this page's"
        if headers.get("sec-fetch-site", "none") not in {"none", "same-origin"} and method not in READING:
            return 403, "found a request from another site; allowed: this page's"
        if not self.is_open and not self._has_token(headers, query):
            return 401, "found no valid token; allowed: the address that was printed, with its token"
        if method not in READING and not self.orders:
            return 403, "orders are off here; allowed: on the loopback interface, or with --view-orders"
        return None

    def _is_own(self, host: str) -> bool:
        try:
            parts = urlsplit(f"//{host}")
            name, port = parts.hostname or "", parts.port
        except ValueError:
            return False
        if port != self.address.port and not (port is None and self.address.port == 80):
            return False
        if self.is_open:
            return name in LOOPBACK_NAMES or name == self.address.host
        return True  # the token is what counts there

    def _has_token(self, headers: dict[str, str], query: str) -> bool:
        given = parse_qs(query, max_num_fields=8).get("token", []) if query else []
        cookies = (each.strip().partition("=") for each in headers.get("cookie", "").split(";"))
        given += [value for name, _, value in cookies if name == COOKIE]
        return any(hmac.compare_digest(each.encode(), self.token.encode()) for each in given)
