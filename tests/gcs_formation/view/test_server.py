"""The page's server: what it serves, to whom, and what it refuses."""

from __future__ import annotations

import asyncio
import json
from dataclasses import dataclass, field
from typing import Any
from urllib.parse import unquote

import pytest
from starlette.types import ASGIApp

from airlink.endpoint import Address
from formation_scenario.orders import Answer
from gcs_formation.view.access import Access
from gcs_formation.view.asked import MAX_BODY
from gcs_formation.view.log import LogRecording
from gcs_formation.view.run import RunRecording
from gcs_formation.view.served_files import served_files
from gcs_formation.view.server import Viewer
from tests.gcs_formation.view.conftest import Flown

HERE = "http://127.0.0.1:8000"
JSON = {"Content-Type": "application/json"}


@dataclass
class Flight:
    """Takes orders, and remembers them."""

    taken: list[str] = field(default_factory=list)
    available: bool = True

    def __call__(self, line: str) -> Answer:
        """Accept an order."""
        self.taken.append(line)
        return Answer(True, f"{line}: accepted")


@dataclass
class Reply:
    """An answer of the server."""

    status_code: int
    headers: dict[str, str]
    content: bytes

    @property
    def text(self) -> str:
        """The body as text."""
        return self.content.decode()

    def json(self) -> Any:
        """The body as JSON."""
        return json.loads(self.content)


@dataclass
class Browser:
    """Asks an application without a network, keeping cookies."""

    app: ASGIApp
    host: str
    cookie: str = ""

    def get(self, path: str, headers: dict[str, str] | None = None) -> Reply:
        """Ask for an address."""
        return self.request("GET", path, headers or {}, b"")

    def post(self, path: str, json_body: object = None, *, content: bytes = b"", headers=None) -> Reply:
        """Send JSON, or other bytes."""
        body = content or json.dumps(json_body).encode()
        return self.request("POST", path, JSON | (headers or {}), body)

    def request(self, method: str, path: str, headers: dict[str, str], body: bytes) -> Reply:
        """Ask for anything."""
        bare, _, query = path.partition("?")
        all_headers = {"host": self.host} | ({"cookie": self.cookie} if self.cookie else {})
        all_headers |= {name.lower(): value for name, value in headers.items()}
        scope = {
            "type": "http", "http_version": "1.1", "method": method, "scheme": "http", "root_path": "",
            "path": unquote(bare), "raw_path": bare.encode(), "query_string": query.encode(),
            "headers": [(name.encode(), value.encode()) for name, value in all_headers.items()],
            "server": ("127.0.0.1", 8000), "client": ("127.0.0.1", 9), "extensions": {},
        }  # fmt: skip
        sent = list[dict[str, Any]]()

        async def receive() -> dict[str, Any]:
            return {"type": "http.request", "body": body, "more_body": False}

        async def send(message: Any) -> None:
            sent.append(dict(message))

        async def once() -> None:
            await self.app(scope, receive, send)

        asyncio.run(once())
        found = {name.decode(): value.decode() for name, value in sent[0]["headers"]}
        self.cookie = found.get("set-cookie", self.cookie).partition(";")[0]
        return Reply(sent[0]["status"], found, b"".join(each.get("body", b"") for each in sent[1:]))


@pytest.fixture
def flight() -> Flight:
    return Flight()


@pytest.fixture
def page(flown: Flown, flight: Flight) -> Browser:
    viewer = Viewer(RunRecording(flown.finished), Access(Address("127.0.0.1", 8000), orders=True), flight)
    return Browser(viewer.app(), "127.0.0.1:8000")


@pytest.fixture
def elsewhere(flown: Flown, flight: Flight) -> Browser:
    access = Access(Address("192.0.2.7", 8000), orders=False, token="secret")
    return Browser(Viewer(RunRecording(flown.finished), access, flight).app(), "192.0.2.7:8000")


def test_the_page_and_all_its_parts_are_served_from_here(page: Browser) -> None:
    answer = page.get("/")
    assert answer.status_code == 200
    assert answer.headers["content-type"].startswith("text/html")
    assert "//" not in answer.text
    assert [f'data-vehicle="{name}"' in answer.text for name in "123"] == [True] * 3  # before its scripts run, too
    for name in served_files():
        assert page.get(f"/static/{name}").status_code == 200
    assert "default-src 'none'" in answer.headers["content-security-policy"]
    assert answer.headers["x-content-type-options"] == "nosniff"


@pytest.mark.parametrize(
    "path",
    ["/static/../server.py", "/static/..%2fserver.py", "/static/%2e%2e/server.py", "/static//etc/passwd", "/run.yaml",
     "/static/vendor/../../run.py", "/static/index.html%00", "/summary.json", "/static/README.md"],
)  # fmt: skip
def test_nothing_else_is_served(page: Browser, path: str) -> None:
    assert page.get(path).status_code == 404


def test_a_state_now_and_at_a_time(page: Browser) -> None:
    assert page.get("/api/state").json()["vehicles"].keys() == {"1", "2", "3"}
    assert page.get("/api/state?at=2").json()["time_s"] == pytest.approx(2.0, abs=0.1)
    assert page.get("/api/state?at=1e9").json()["time_s"] == page.get("/api/state").json()["time_s"]
    for wrong in ("x", "nan", "", "1e999"):
        assert page.get(f"/api/state?at={wrong}").status_code == 400


def test_ticks_are_bounded_whatever_is_asked_for(page: Browser) -> None:
    for query in ("", "from=-5&to=1e300", "rows=0", "rows=nan&from=x", "from_s=1&to_s=3", "from=9&to=2"):
        assert page.get(f"/api/ticks?{query}").status_code == 200


def test_meta_is_json_and_keeps_texts_as_they_are(page: Browser) -> None:
    meta = page.get("/api/meta").json()
    assert meta["scene"]["name"] == "<script>alert(1)</script>"
    assert meta["orders"] is True
    assert len(meta["scene"]["path"]) > 2


def test_events_come_in_pages(page: Browser) -> None:
    first = page.get("/api/events").json()
    assert first["next"] == first["total"] > 3
    assert page.get(f"/api/events?after={first['next']}").json()["events"] == []


@pytest.mark.parametrize(
    "host", ["evil.example:8000", "127.0.0.1:9", "127.0.0.1", "127.0.0.1.evil.example:8000", "", "[::1"]
)
def test_a_host_that_is_not_this_one_is_refused(page: Browser, host: str) -> None:
    """DNS rebinding: a page of another site, whose name has come to mean this machine, must not get an answer."""
    assert page.get("/api/state", headers={"Host": host}).status_code == 403


@pytest.mark.parametrize(
    "origin", ["http://evil.example", "http://127.0.0.1:9", "null", "http://127.0.0.1:8000.evil.example"]
)
def test_a_forged_origin_is_refused(page: Browser, flight: Flight, origin: str) -> None:
    assert page.get("/api/meta", headers={"Origin": origin}).status_code == 403
    answer = page.post("/api/order", {"order": "loiter"}, headers={"Origin": origin})
    assert answer.status_code == 403
    assert flight.taken == []


def test_an_order_is_passed_on_and_answered(page: Browser, flight: Flight) -> None:
    answer = page.post("/api/order", {"order": " shape  line 40 "}, headers={"Origin": HERE}).json()
    assert answer == {"accepted": True, "text": "shape line 40: accepted", "ends": False}
    assert page.post("/api/order", {"order": "land", "check": True}).json()["ends"] is True
    assert flight.taken == ["shape line 40", "check land"]


def test_what_is_no_order_is_refused_before_it_is_sent(page: Browser, flight: Flight) -> None:
    assert "allowed: shape NAME" in page.post("/api/order", {"order": "jump"}).json()["text"]
    assert flight.taken == []


def test_a_link_is_impaired_by_the_scenarios_keys(page: Browser, flight: Flight) -> None:
    assert page.post("/api/link", {"vehicles": [2], "delay_ms": 300}).json()["accepted"]
    assert [json.loads(line.removeprefix("link ")) for line in flight.taken] == [{"vehicles": [2], "delay_ms": 300}]


@pytest.mark.parametrize(
    ("body", "headers"),
    [(b"{", JSON), (b"[]", JSON), (b"1" * (MAX_BODY + 1), JSON), (b"[" * 1500, JSON), (b'{"order": 5}', JSON),
     (b'{"order": "loiter"}', {"Content-Type": "text/plain"}), (b"\xff\xfe", JSON)],
)  # fmt: skip
def test_what_is_no_small_object_of_json_is_refused(page: Browser, flight: Flight, body: bytes, headers) -> None:
    """A form of another site can send text/plain without asking; JSON it can't."""
    assert page.post("/api/order", content=body, headers=headers).status_code == 400
    assert flight.taken == []


def test_another_interface_needs_the_token(elsewhere: Browser) -> None:
    for path in ("/", "/api/state", "/static/page.js", "/api/stream"):
        assert elsewhere.get(path).status_code == 401
    assert elsewhere.get("/?token=wrong").status_code == 401
    assert elsewhere.get("/?token=secret").status_code == 200
    assert elsewhere.get("/api/state").status_code == 200  # by the cookie that came with the page


def test_orders_are_off_on_another_interface(elsewhere: Browser, flight: Flight) -> None:
    elsewhere.get("/?token=secret")
    assert elsewhere.get("/api/meta").json()["orders"] is False
    assert elsewhere.post("/api/order", {"order": "loiter"}).status_code == 403
    assert flight.taken == []


def test_the_printed_address_has_the_token_only_where_it_is_needed() -> None:
    assert Access(Address("127.0.0.1", 80), orders=True).url == "http://127.0.0.1:80/"
    assert Access(Address("::1", 80), orders=True).url == "http://[::1]:80/"
    shown = Access(Address("0.0.0.0", 80), orders=False)
    assert shown.url == f"http://0.0.0.0:80/?token={shown.token}"
    assert len(shown.token) >= 32


def test_a_log_takes_no_orders(flown: Flown) -> None:
    viewer = Viewer(LogRecording(flown.finished / "flight.tlog"), Access(Address("127.0.0.1", 8000), orders=True))
    client = Browser(viewer.app(), "127.0.0.1:8000")
    assert client.get("/api/meta").json()["orders"] is False
    answer = client.post("/api/order", {"order": "loiter"}).json()
    assert (answer["accepted"], answer["text"]) == (False, "no flight is under way here")
