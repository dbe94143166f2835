"""Serves the page on a socket until a signal ends it, or its flight is over and no browser looks on."""

from __future__ import annotations

import asyncio
import socket
from collections.abc import Callable

import uvicorn

from gcs_formation.view.server import POLL_S, Viewer

MAX_HEADER = 16_384


async def serve(viewer: Viewer, listening: socket.socket, is_over: Callable[[], bool] | None = None) -> None:
    """Serve until a signal ends it, or, with `is_over`, until the flight is over and no browser looks on."""
    config = uvicorn.Config(
        viewer.app(),
        log_level="critical",
        access_log=False,
        server_header=False,
        date_header=False,
        proxy_headers=False,
        ws="none",
        http="h11",
        loop="asyncio",
        limit_concurrency=128,
        timeout_keep_alive=5,
        timeout_graceful_shutdown=2,
        h11_max_incomplete_event_size=MAX_HEADER,
    )
    server = uvicorn.Server(config)
    watching = asyncio.create_task(_watch(server, viewer, is_over))
    try:
        await server.serve(sockets=[listening])
    finally:
        watching.cancel()


async def _watch(server: uvicorn.Server, viewer: Viewer, is_over: Callable[[], bool] | None) -> None:
    """End the server when the flight is over and no browser looks on; tell browsers when it ends."""
    while not server.should_exit:
        if is_over is not None and is_over() and viewer.is_left:
            server.should_exit = True
        await asyncio.sleep(POLL_S)
    viewer.closing = True
