"""What strangers may send to the page's server: refused or bounded, and others are served meanwhile."""

from __future__ import annotations

import asyncio
import json
import socket
from collections.abc import Awaitable, Callable, Iterator
from contextlib import contextmanager
from pathlib import Path
from threading import Thread

import pytest

from airlink.endpoint import Address
from airlink.frame import FrameWriter
from airlink.messages.system import Heartbeat, Statustext
from gcs_formation.view.access import Access
from gcs_formation.view.asked import MAX_BODY
from gcs_formation.view.listening import listening_socket
from gcs_formation.view.log import LogRecording
from gcs_formation.view.run import RunRecording
from gcs_formation.view.server import MAX_STREAMS, Viewer
from gcs_formation.view.serving import MAX_HEADER, serve
from gcs_formation.view.tiles import TileError, Tiles
from tests.gcs_formation.view.conftest import Flown

LIMIT_S = 20.0
"""For what takes milliseconds on a machine with nothing else to do."""


@contextmanager
def served(flown: Flown) -> Iterator[Address]:
    """Serve a finished flight on loopback; yield where."""
    listening = listening_socket("127.0.0.1", 0)
    address = Address("127.0.0.1", listening.getsockname()[1])
    viewer, over = Viewer(RunRecording(flown.finished), Access(address, orders=True)), list[bool]()
    viewer.last_left_s = -1e9  # as if the last browser had left long ago
    thread = Thread(target=lambda: asyncio.run(serve(viewer, listening, lambda: bool(over))))
    thread.start()
    try:
        yield address
    finally:
        over.append(True)
        viewer.streams, viewer.last_left_s = 0, -1e9
        thread.join(LIMIT_S)
        listening.close()
        assert not thread.is_alive()


def sent(address: Address, data: bytes, *, ends: bool = True) -> bytes:
    """Return the answer to some bytes, until the server closes the connection; `ends`: we send no more, and say so."""
    with socket.create_connection((address.host, address.port), LIMIT_S) as connection:
        found = b""
        try:
            connection.sendall(data)
            if ends:
                connection.shutdown(socket.SHUT_WR)
            while chunk := connection.recv(65536):
                found += chunk
        except (ConnectionResetError, BrokenPipeError):
            pass
        return found


def asked(address: Address, path: str = "/api/state", *lines: str) -> bytes:
    """Return the answer to a request for an address."""
    head = [f"GET {path} HTTP/1.1", f"Host: {address.host}:{address.port}", "Connection: close", *lines, "", ""]
    return sent(address, "\r\n".join(head).encode(), ends=False)


def is_well(answer: bytes) -> bool:
    """Return whether an answer is a page's."""
    return answer.startswith(b"HTTP/1.1 200")


@pytest.fixture(scope="module")
def address(flown: Flown) -> Iterator[Address]:
    with served(flown) as found:
        yield found


@pytest.mark.parametrize(
    "garbage",
    [b"", b"\x00" * 5000, bytes(range(256)) * 40, b"GET", b"GET / HTTP/9.9\r\n\r\n", b"\xfd" * 300,
     b"GET / HTTP/1.1\r\nHost: a\r\nHost: b\r\n\r\n", b"POST /api/order HTTP/1.1\r\nContent-Length: -5\r\n\r\n",
     b"GET /" + b"a" * (2 * MAX_HEADER) + b" HTTP/1.1\r\n\r\n",
     b"GET / HTTP/1.1\r\nX: " + b"a" * (2 * MAX_HEADER) + b"\r\n\r\n",
     b"POST /api/order HTTP/1.1\r\nTransfer-Encoding: chunked\r\n\r\nffffffffffffffffff\r\n"],
)  # fmt: skip
def test_garbage_and_oversized_requests_get_no_page_and_others_do(address: Address, garbage: bytes) -> None:
    assert not is_well(sent(address, garbage))
    assert is_well(asked(address))


def test_a_body_without_end_is_cut_off(address: Address) -> None:
    """Ten megabytes are announced and sent; the server answers when it has read as much as it takes."""
    where = f"Host: {address.host}:{address.port}\r\nContent-Type: application/json\r\n"
    head = f"POST /api/order HTTP/1.1\r\n{where}Content-Length: 10000000\r\n\r\n".encode()
    with socket.create_connection((address.host, address.port), LIMIT_S) as connection:
        connection.sendall(head + b"1" * (2 * MAX_BODY))
        assert connection.recv(100).startswith(b"HTTP/1.1 400")
    assert is_well(asked(address))


def test_many_slow_readers_do_not_stop_others(address: Address) -> None:
    """Each asks for all ticks and for the stream, and reads nothing."""
    open_now = [socket.create_connection((address.host, address.port), LIMIT_S) for _ in range(MAX_STREAMS // 2)]
    try:
        for number, each in enumerate(open_now):
            path = "/api/stream" if number % 2 else "/api/ticks"
            each.sendall(f"GET {path} HTTP/1.1\r\nHost: {address.host}:{address.port}\r\n\r\n".encode())
        half = socket.create_connection((address.host, address.port), LIMIT_S)
        half.sendall(b"GET /api/state HT")  # and one who never ends a line
        open_now.append(half)
        assert is_well(asked(address))
        assert is_well(asked(address, "/"))
    finally:
        for each in open_now:
            each.close()


def test_streams_are_counted_and_bounded(flown: Flown) -> None:
    viewer = Viewer(RunRecording(flown.finished), Access(Address("127.0.0.1", 80), orders=True))
    viewer.streams = MAX_STREAMS
    assert _status(viewer, b"/api/stream") == 503


@pytest.mark.parametrize("path", ["/..%2f..%2fetc/passwd", "/static/%2e%2e/%2e%2e/run.yaml", "/static/..\\..\\run.yaml",
                                  "//etc/passwd", "/static/vendor/%00", "/static/\u202e"])  # fmt: skip
def test_paths_that_climb_are_not_found(flown: Flown, path: str) -> None:
    viewer = Viewer(RunRecording(flown.finished), Access(Address("127.0.0.1", 80), orders=True))
    assert _status(viewer, path.encode()) == 404


def test_a_log_of_nothing_but_texts_is_bounded(tmp_path: Path) -> None:
    """More chunks of a text than any vehicle sends, none of them the last."""
    vehicle, file = FrameWriter(7, 1), tmp_path / "texts.tlog"
    frames = [vehicle.encode(Heartbeat(1, 3, 128, 15))]
    frames += [vehicle.encode(Statustext(2, "x" * 50, 1, number % 256)) for number in range(200)]
    file.write_bytes(b"".join((10**15 + 1000 * i).to_bytes(8, "big") + raw for i, raw in enumerate(frames)))
    texts = [event for event in LogRecording(file).events if event["kind"] == "statustext"]
    assert max(len(event["text"]) for event in texts) <= 1000


@pytest.mark.parametrize(
    "address",
    ["", "https://map.example/{z}/{x}.png", "http://map.example/{z}/{x}/{y}.png", "ftp://map.example/{z}/{x}/{y}",
     "https://u@map.example/{z}/{x}/{y}", "https://a; script-src *//{z}/{x}/{y}", "https://map.example:99999/{z}/{x}/{y}",
     "https://map.example 'unsafe-inline'/{z}/{x}/{y}", "javascript:alert({z}{x}{y})", "https:///{z}/{x}/{y}"],
)  # fmt: skip
def test_an_address_that_is_none_of_tiles_is_refused(address: str) -> None:
    """Above all one that would write further rules into the page's policy."""
    with pytest.raises(TileError, match="allowed: https://HOST"):
        Tiles.at(address)


def test_only_the_origin_of_tiles_joins_the_policy(flown: Flown) -> None:
    tiles = Tiles.at("https://map.example:8443/a/{z}/{x}/{y}.png?key=secret")
    assert tiles.origin == "https://map.example:8443"
    access = Access(Address("127.0.0.1", 80), orders=True)
    policies = [
        _headers(Viewer(RunRecording(flown.finished), access, tiles=each), b"/")["content-security-policy"]
        for each in (None, tiles)
    ]
    assert "//" not in policies[0]
    assert policies[1] == policies[0].replace("data:", "data: https://map.example:8443")
    assert "unsafe-inline" not in policies[1]


def _started(viewer: Viewer, path: bytes) -> dict[str, object]:
    sent_back = list[dict[str, object]]()

    async def receive() -> dict[str, object]:
        return {"type": "http.request", "body": b"", "more_body": False}

    async def send(message: object) -> None:
        sent_back.append(json.loads(json.dumps(message, default=lambda value: value.decode("latin-1"))))

    app: Callable[..., Awaitable[None]] = viewer.app()
    scope = {
        "type": "http", "http_version": "1.1", "method": "GET", "scheme": "http", "root_path": "", "query_string": b"",
        "path": path.decode(), "raw_path": path, "headers": [(b"host", b"127.0.0.1")], "server": ("127.0.0.1", 80),
        "client": ("127.0.0.1", 9), "extensions": {},
    }  # fmt: skip
    asyncio.run(app(scope, receive, send))  # type: ignore[arg-type]
    return sent_back[0]


def _status(viewer: Viewer, path: bytes) -> object:
    return _started(viewer, path)["status"]


def _headers(viewer: Viewer, path: bytes) -> dict[str, str]:
    return dict(_started(viewer, path)["headers"])  # type: ignore[call-overload]
