"""The page's application: what a browser may ask of a recording and of the flight, and what it is answered."""

from __future__ import annotations

import asyncio
import base64
import json
import time
from collections.abc import AsyncIterator, Callable, Mapping
from concurrent.futures import ThreadPoolExecutor
from contextlib import asynccontextmanager
from functools import partial
from html import escape
from typing import Any, Protocol, TypeVar

import numpy as np
from starlette.applications import Starlette
from starlette.requests import Request
from starlette.responses import JSONResponse, Response, StreamingResponse
from starlette.routing import Route
from starlette.types import ASGIApp

from formation_scenario.orders import Answer, OrderError, read_order
from gcs_formation.errors import NothingRunningError, RecordError
from gcs_formation.view.access import COOKIE, Access
from gcs_formation.view.asked import number, small_object
from gcs_formation.view.guard import Guard
from gcs_formation.view.recording import Recording, chosen, described, packed, state_at
from gcs_formation.view.served_files import served_files
from gcs_formation.view.tiles import Tiles

Result = TypeVar("Result")


class Orders(Protocol):
    """The way of orders to a flight."""

    @property
    def available(self) -> bool:
        """Whether a flight takes them at present."""
        ...

    def __call__(self, line: str) -> Answer:
        """Give an order; return the flight's answer.

        Raises:
            NothingRunningError: no flight answers.
        """
        ...


VEHICLES = b"<!-- vehicles -->"
"""Where the page names the vehicles, until its scripts show them."""
POLL_S = 0.1
"""Time between looks at the record."""
STREAM_S = 0.1
KEEP_ALIVE_S = 1.0
MAX_STREAMED = 10
"""Ticks in a message of the stream; what a browser missed beyond that is left out."""
MAX_EVENTS = 500
MAX_STREAMS = 32
STAYS_S = 10.0
"""How long a viewer of a flight that is over stays after its last browser."""
FIRST_S = 15.0
"""How long after its start it waits for the first one: a flight on the virtual clock is over in a second."""
NEVER = -1.0


class Viewer:
    """One recording, the browsers that look at it, and the way of orders to the flight."""

    def __init__(
        self, recording: Recording, access: Access, orders: Orders | None = None, tiles: Tiles | None = None
    ) -> None:
        """Serve a recording; `orders` reach its flight, None where there is none; `tiles`: a map beneath the plan."""
        self.recording, self.access, self._give, self._tiles = recording, access, orders, tiles
        self._reader = ThreadPoolExecutor(1, "recording")
        """Everything that reads the recording is done in one thread, and never in the one that serves."""
        self._ordering = ThreadPoolExecutor(1, "orders")
        self._parts = served_files()
        self.failure: str | None = None
        self.closing = False
        """Whether it is about to end: browsers are notified, so that they don't ask again."""
        self.streams = 0
        self._began_s, self.last_left_s = time.monotonic(), NEVER
        """When the last browser left; `NEVER` before any came. Browsers are people's: they come and go in wall time."""

    def app(self) -> ASGIApp:
        """Return the application, guarded."""
        routes = [
            Route("/", self._page),
            Route("/static/{name:path}", self._static),
            Route("/api/meta", self._meta),
            Route("/api/state", self._state),
            Route("/api/ticks", self._ticks),
            Route("/api/events", self._events),
            Route("/api/stream", self._stream),
            Route("/api/order", self._order, methods=["POST"]),
            Route("/api/link", self._link, methods=["POST"]),
        ]
        images = "" if self._tiles is None else self._tiles.origin
        return Guard(Starlette(routes=routes, lifespan=self._lifespan), self.access, images)

    @property
    def is_left(self) -> bool:
        """Whether no browser looks on any more, nor is likely to."""
        now_s = time.monotonic()
        if self.last_left_s == NEVER:
            return self.streams == 0 and now_s - self._began_s > FIRST_S
        return self.streams == 0 and now_s - self.last_left_s > STAYS_S

    async def _read(self, what: Callable[[], Result]) -> Result:
        return await asyncio.get_running_loop().run_in_executor(self._reader, what)

    @asynccontextmanager
    async def _lifespan(self, _: Starlette) -> AsyncIterator[None]:
        following = asyncio.create_task(self._follow())
        try:
            yield
        finally:
            following.cancel()
            self._reader.shutdown(wait=False, cancel_futures=True)
            self._ordering.shutdown(wait=False, cancel_futures=True)

    async def _follow(self) -> None:
        while True:
            try:
                await self._read(lambda: self.recording.poll(time.monotonic()))
                self.failure = None
            except RecordError as error:
                self.failure = str(error)
            await asyncio.sleep(POLL_S)

    async def _page(self, request: Request) -> Response:
        page, vehicles = self._parts["index.html"], await self._read(lambda: self.recording.vehicles)
        listed = "".join(f'<li data-vehicle="{escape(name)}">Vehicle {escape(name)}</li>' for name in vehicles)
        response = Response(page.data.replace(VEHICLES, listed.encode()), media_type=page.kind)
        if not self.access.is_open and "token" in request.query_params:
            response.set_cookie(COOKIE, self.access.token, httponly=True, samesite="strict")
        return response

    async def _static(self, request: Request) -> Response:
        part = self._parts.get(request.path_params["name"])
        if part is None:
            return JSONResponse({"error": "found no such file"}, 404)
        return Response(part.data, media_type=part.kind)

    async def _meta(self, _: Request) -> Response:
        return JSONResponse(await self._read(self._described))

    def _described(self) -> dict[str, Any]:
        orders = self._give is not None and self.access.orders and self._give.available
        tiles = None if self._tiles is None else self._tiles.address
        return described(self.recording) | {"orders": orders, "failure": self.failure, "tiles": tiles}

    async def _state(self, request: Request) -> Response:
        at_s: float | None = None
        if "at" in request.query_params:
            at_s = number(request.query_params["at"])
            if at_s is None:
                return JSONResponse({"error": "at: found no number; allowed: seconds since the run's clock began"}, 400)
        return JSONResponse(await self._read(lambda: state_at(self.recording, at_s)))

    async def _ticks(self, request: Request) -> Response:
        asked = {name: number(request.query_params.get(name, "")) for name in ("from", "to", "rows", "from_s", "to_s")}

        def read() -> bytes:
            times_s = self.recording.times.time_s
            count = times_s.size
            begin, end = asked["from"] or 0, count if asked["to"] is None else asked["to"]
            if asked["from_s"] is not None:
                begin = int(np.searchsorted(times_s, asked["from_s"]))
            if asked["to_s"] is not None:
                end = int(np.searchsorted(times_s, asked["to_s"], side="right"))
            rows = int(min(max(asked["rows"] or 1e9, 1), 1e9))
            ticks = chosen(count, len(self.recording.vehicles), int(min(begin, count)), int(min(end, count)), rows)
            return packed(self.recording, ticks)

        return Response(await self._read(read), media_type="application/octet-stream")

    async def _events(self, request: Request) -> Response:
        after = int(min(max(number(request.query_params.get("after", "")) or 0, 0), 1e9))
        found = list(self.recording.events[after : after + MAX_EVENTS])
        return JSONResponse({"events": found, "next": after + len(found), "total": len(self.recording.events)})

    async def _stream(self, request: Request) -> Response:
        if self.streams >= MAX_STREAMS:
            return JSONResponse({"error": f"found {MAX_STREAMS} browsers already; allowed: no more"}, 503)
        return StreamingResponse(self._messages(request), media_type="text/event-stream")

    async def _messages(self, request: Request) -> AsyncIterator[str]:
        """Yield what is new, as often as the browser takes it; a slow one is sent less, and what is newest."""
        self.streams += 1
        try:
            known, sent, sent_s = self.recording.times.time_s.size, None, NEVER
            while not (self.closing or await request.is_disconnected()):
                now_s, count, generation = time.monotonic(), self.recording.times.time_s.size, self.recording.generation
                status = (self.recording.state, generation, len(self.recording.events), self.failure)
                if status != sent or now_s - sent_s > KEEP_ALIVE_S:
                    names = ("state", "generation", "events", "failure")
                    yield _message("status", json.dumps(dict(zip(names, status, strict=True)) | {"ticks": int(count)}))
                    sent, sent_s = status, now_s
                if count > known:
                    ticks = await self._read(partial(self._newest, known, count))
                    yield _message("ticks", base64.b64encode(ticks).decode("ascii"))
                known = count
                await asyncio.sleep(STREAM_S)
            if self.closing:
                yield _message("bye", "{}")
        finally:
            self.streams -= 1
            self.last_left_s = time.monotonic()

    def _newest(self, begin: int, end: int) -> bytes:
        vehicles = len(self.recording.vehicles)
        return packed(self.recording, chosen(end, vehicles, begin, end, MAX_STREAMED * vehicles))

    async def _order(self, request: Request) -> Response:
        given = await small_object(request)
        text = given.get("order") if given is not None else None
        if not isinstance(text, str):
            return JSONResponse({"error": 'found no order; allowed: {"order": "shape line", "check": true}'}, 400)
        try:
            order = read_order(text)
        except OrderError as error:
            return JSONResponse({"accepted": False, "text": str(error)})
        ends = order.end is not None
        line = f"check {order.text}" if given is not None and given.get("check") else order.text
        return await self._given(line, {"ends": ends})

    async def _link(self, request: Request) -> Response:
        given = await small_object(request)
        if given is None:
            return JSONResponse({"error": 'found no link; allowed: {"vehicles": [2], "delay_ms": 300}'}, 400)
        return await self._given(f"link {json.dumps(given, separators=(',', ':'))}", {})

    async def _given(self, line: str, more: Mapping[str, Any]) -> Response:
        give = self._give
        if give is None:
            return JSONResponse({"accepted": False, "text": "no flight is under way here", **more})
        try:
            answer = await asyncio.get_running_loop().run_in_executor(self._ordering, lambda: give(line))
        except NothingRunningError as error:
            return JSONResponse({"accepted": False, "text": str(error), **more})
        return JSONResponse({**answer._asdict(), **more})


def _message(kind: str, data: str) -> str:
    return f"event: {kind}\ndata: {data}\n\n"
