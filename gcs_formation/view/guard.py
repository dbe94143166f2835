"""Refuses requests that `Access` doesn't allow, and adds the headers of every answer."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any

from starlette.responses import JSONResponse
from starlette.types import ASGIApp, Receive, Scope, Send

from gcs_formation.view.access import Access

OWN_IMAGES = "'self' data:"
HEADERS = {
    "X-Content-Type-Options": "nosniff",
    "Referrer-Policy": "no-referrer",
    "Cross-Origin-Resource-Policy": "same-origin",
    "Cache-Control": "no-store",
}


def policy(images: str = "") -> str:
    """Return the content security policy: nothing but what this server has, and images of one other origin if given.

    'unsafe-eval' is for programs that drive the page, such as Playwright, whose waits evaluate expressions in it. No
    script of the page evaluates text.
    """
    return (
        "default-src 'none'; script-src 'self' 'unsafe-eval'; style-src 'self'; "
        f"img-src {f'{OWN_IMAGES} {images}'.strip()}; "
        "connect-src 'self'; base-uri 'none'; form-action 'none'; frame-ancestors 'none'"
    )


class Guard:
    """Stands before an application."""

    def __init__(self, app: ASGIApp, access: Access, images: str = "") -> None:
        """Wrap an application whose page may show images of a further origin, `images`."""
        self._app, self._access = app, access
        headers: Mapping[str, str] = HEADERS | {"Content-Security-Policy": policy(images)}
        self._headers = [(name.lower().encode(), value.encode()) for name, value in headers.items()]

    async def __call__(self, scope: Scope, receive: Receive, send: Send) -> None:
        """Answer a request."""
        if scope["type"] != "http":
            await self._app(scope, receive, send)
            return
        headers = {name.decode("latin-1"): value.decode("latin-1") for name, value in scope["headers"]}
        query = scope["query_string"].decode("latin-1")
        refused = self._access.refusal(scope["method"], headers, query)

        async def with_headers(message: Any) -> None:  # noqa: ANN401 - as ASGI has it
            if message["type"] == "http.response.start":
                message["headers"] = [*message["headers"], *self._headers]
            await send(message)

        if refused is not None:
            status, reason = refused
            await JSONResponse({"error": reason}, status)(scope, receive, with_headers)
            return
        await self._app(scope, receive, with_headers)
