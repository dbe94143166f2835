"""The page in a real browser, headless: a Chromium of the distribution, driven by Playwright.

Where either is missing these tests are left out, and the summary says so: pip install playwright, apt install chromium.
"""

from __future__ import annotations

import base64
import json
import math
import re
import shutil
import signal
import subprocess
import sys
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path
from typing import Any

import pytest

from airlink.frame import FrameWriter
from airlink.messages.system import Heartbeat, Statustext
from tests.flights.conftest import scenario
from tests.gcs_formation.view.conftest import Flown

api = pytest.importorskip("playwright.sync_api", reason="the page in a browser: found no playwright")
CHROMIUM = next(
    (found for name in ("chromium", "chromium-browser", "google-chrome") if (found := shutil.which(name))), None
)
FLAGS = (
    *("--no-sandbox", "--disable-gpu", "--disable-quic", "--no-first-run"),
    *("--disable-background-networking", "--disable-component-update", "--disable-sync"),
)
pytestmark = [
    pytest.mark.browser,
    pytest.mark.skipif(CHROMIUM is None, reason="the page in a browser: found no Chromium"),
]
PNG = base64.b64decode(
    "iVBORw0KGgoAAAANSUhEUgAAAAEAAAABCAYAAAAfFcSJAAAADUlEQVR42mNk+M9QDwADhgGAWjR9awAAAABJRU5ErkJggg=="
)
"""A picture of one pixel."""
WAIT_MS = 60_000
"""For what takes a second on a machine with nothing else to do."""


@pytest.fixture(scope="module")
def chromium() -> Iterator[Any]:
    with api.sync_playwright() as driver:
        opened = driver.chromium.launch(executable_path=CHROMIUM, args=list(FLAGS))
        yield opened
        opened.close()


@pytest.fixture
def tab(chromium: Any) -> Iterator[Any]:
    """A page that fails its test by an error in its console, or by asking anybody but this machine."""
    context = chromium.new_context(viewport={"width": 1280, "height": 800})
    page, wrong = context.new_page(), list[str]()
    page.set_default_timeout(WAIT_MS)
    page.on("console", lambda message: wrong.append(message.text) if message.type == "error" else None)
    page.on("pageerror", lambda error: wrong.append(str(error)))
    page.on(
        "request",
        lambda asked: None if "//127.0.0.1:" in asked.url or asked.url.startswith("data:") else wrong.append(asked.url),
    )
    yield page
    context.close()
    assert wrong == []


@contextmanager
def started(*arguments: str) -> Iterator[tuple[subprocess.Popen[str], str]]:
    """Yield a command's process, and the address that it prints."""
    command = [sys.executable, "-m", "gcs_formation", *arguments]
    with subprocess.Popen(command, stdout=subprocess.PIPE, stderr=subprocess.DEVNULL, text=True) as process:
        try:
            assert process.stdout is not None
            word, address = process.stdout.readline().split()
            assert word == "view"
            yield process, address
        finally:
            process.terminate()


@pytest.fixture
def flying(tmp_path: Path) -> Iterator[tuple[subprocess.Popen[str], str]]:
    """A flight of `run` in real time, with its viewer."""
    file = tmp_path / "seen.yaml"
    keys = scenario(
        duration_s=120, vehicles={"count": 3}, path={"speed_mps": 22, "waypoints_m": [[0, 0, 100], [4000, 0, 100]]}
    )
    file.write_text(json.dumps(keys))
    with started("run", str(file), "--out", str(tmp_path / "run"), "--view") as found:
        yield found


def text_of(tab: Any, name: str) -> str:
    return str(tab.inner_text(f'[data-vehicle="{name}"]'))


def test_a_finished_flight_is_shown_replayed_and_sought_in(flown: Flown, tab: Any) -> None:
    with started("view", str(flown.finished)) as (_, address):
        tab.goto(address)
        tab.wait_for_selector("#viewer[data-ready]")
        assert tab.inner_text("h1") == "<script>alert(1)</script>"  # a name is text
        assert {each.get_attribute("data-vehicle") for each in tab.query_selector_all("[data-vehicle]")} == {
            "1",
            "2",
            "3",
        }
        before = float(tab.get_attribute("#viewer", "data-time"))
        tab.wait_for_function(
            "before => Number(document.getElementById('viewer').dataset.time) > before + 0.5", arg=before
        )
        tab.evaluate("gcsView.clock.toggle(); gcsView.clock.seek(3)")
        tab.wait_for_function("() => Number(document.getElementById('viewer').dataset.time) === 3")
        assert tab.inner_text(".state") == "ended"
        tab.keyboard.press("3")
        tab.wait_for_selector("canvas.space")
        tab.click('[data-tab="events"]')
        assert "phase: flying" in tab.inner_text(".events")


def test_nothing_needs_text_to_be_evaluated(flown: Flown, tab: Any) -> None:
    """The policy forbids it: a refusal would be an error in the console, which fails the test."""
    with started("view", str(flown.finished)) as (_, address):
        policy = tab.goto(address).headers["content-security-policy"]
        assert "unsafe-inline" not in policy
        tab.wait_for_selector("#viewer[data-ready]")
        for name in ("links", "events", "orders", "vehicles"):
            tab.click(f'[data-tab="{name}"]')
        tab.keyboard.press("3")
        tab.wait_for_selector("canvas.space")
        tab.wait_for_timeout(300)


def test_tiles_are_fetched_from_the_given_server_alone_and_only_if_it_is_given(flown: Flown, tab: Any) -> None:
    asked = list[str]()
    tab.route("**/tile/**", lambda route: (asked.append(route.request.url), route.fulfill(body=PNG)))
    with started("view", str(flown.finished)) as (_, address):
        tab.goto(address)
        tab.wait_for_selector("#viewer[data-ready]")
        tab.wait_for_timeout(500)
        assert asked == []
    tiles = "http://127.0.0.1:9/tile/{z}/{x}/{y}.png?key=K"
    with started("view", str(flown.finished), "--view-tiles", tiles) as (_, address):
        tab.goto(address)
        with tab.expect_request("**/tile/**"):
            tab.wait_for_selector("#viewer[data-ready]")
        tab.wait_for_timeout(500)
    form = re.compile(r"http://127\.0\.0\.1:9/tile/(\d+)/(\d+)/(\d+)\.png\?key=K")
    numbers = [tuple(map(int, found.groups())) for found in map(form.fullmatch, asked) if found is not None]
    assert len(numbers) == len(asked)
    zoom, x, y = numbers[0]
    # The scenario's origin, 35 degrees north and 125 east, by the formula of the projection; 600 m of a plan around it.
    at_x, at_y = 2**zoom * (125 / 360 + 0.5), 2**zoom * (1 - math.asinh(math.tan(math.radians(35))) / math.pi) / 2
    assert math.hypot(x + 0.5 - at_x, y + 0.5 - at_y) < 8


def test_texts_of_vehicles_scenarios_and_logs_are_text(tab: Any, tmp_path: Path) -> None:
    """A mode, a text and a file's name that are HTML: shown as they are, and nothing of them becomes an element."""
    shown = "<img src=x onerror=alert(1)><script>alert(2)</script>"
    vehicle, file = FrameWriter(7, 1), tmp_path / "<b onclick=alert(3)>.tlog"
    frames = [
        vehicle.encode(Heartbeat(1, 3, 128, 15)),
        vehicle.encode(Statustext(2, shown[:50], 1, 0)),
        vehicle.encode(Statustext(2, shown[50:], 1, 1)),
    ]
    file.write_bytes(b"".join((10**15 + 10**6 * i).to_bytes(8, "big") + raw for i, raw in enumerate(frames)))
    with started("view", str(file)) as (_, address):
        tab.goto(address)
        tab.wait_for_selector("#viewer[data-ready]")
        assert tab.inner_text("h1") == file.name
        tab.wait_for_function("text => document.querySelector('.card .text').textContent === text", arg=shown)
        tab.click('[data-tab="events"]')
        assert shown in tab.inner_text(".events")
        assert tab.query_selector_all("#viewer :is(img, script, b[onclick])") == []


def test_telemetry_that_is_rejected_is_marked_on_its_card_until_it_is_accepted_again(
    flown: Flown, tab: Any, tmp_path: Path
):
    run = tmp_path / "doubted"
    shutil.copytree(flown.finished, run)
    with (run / "events.jsonl").open("a") as events:
        for t_s, healthy in ((2.0, False), (4.0, True)):
            line = {
                "t_s": t_s,
                "kind": "health",
                "text": "…",
                "vehicle": "2",
                "quantity": "heading",
                "healthy": healthy,
            }
            events.write(json.dumps(line) + "\n")
    with started("view", str(run)) as (_, address):
        tab.goto(address)
        tab.wait_for_selector("#viewer[data-ready]")
        mark = tab.locator('[data-vehicle="2"] .doubt')
        tab.evaluate("gcsView.clock.playing = false; gcsView.clock.seek(3)")
        tab.wait_for_function("() => /heading/.test(document.querySelector('[data-vehicle=\"2\"] .doubt').textContent)")
        assert tab.inner_text('[data-vehicle="3"] .doubt') == ""
        tab.evaluate("gcsView.clock.seek(4.5)")
        tab.wait_for_function("() => document.querySelector('[data-vehicle=\"2\"] .doubt').textContent === ''")
        assert mark.count() == 1


def test_a_log_of_any_is_shown(flown: Flown, tab: Any) -> None:
    with started("view", str(flown.finished / "flight.tlog")) as (_, address):
        tab.goto(address)
        tab.wait_for_selector("#viewer[data-ready]")
        tab.wait_for_function("() => /GUIDED/.test(document.querySelector('[data-vehicle=\"2\"]').textContent)")


@pytest.mark.parametrize(("width", "height"), [(390, 844), (1280, 800), (3840, 2160)])
def test_nothing_is_cut_off_sideways(flown: Flown, tab: Any, width: int, height: int) -> None:
    tab.set_viewport_size({"width": width, "height": height})
    with started("view", str(flown.finished)) as (_, address):
        tab.goto(address)
        tab.wait_for_selector("#viewer[data-ready]")
        assert tab.evaluate("document.documentElement.scrollWidth") <= width
        for selector in (".timebar", ".side", ".charts", ".view"):
            box = tab.query_selector(selector).bounding_box()
            assert box["x"] >= 0
            assert box["x"] + box["width"] <= width + 1


@pytest.mark.slow
def test_a_flight_under_way_moves_takes_orders_and_shows_that_its_station_was_killed(flying, tab: Any) -> None:
    process, address = flying
    tab.goto(address)
    tab.wait_for_selector("#viewer[data-ready]")
    tab.wait_for_function("() => /GUIDED/.test(document.querySelector('[data-vehicle=\"2\"]').textContent)")
    before = text_of(tab, "2")
    tab.wait_for_function("text => document.querySelector('[data-vehicle=\"2\"]').innerText !== text", arg=before)
    tab.click('[data-tab="orders"]')
    tab.fill("[aria-label=Order]", "speed 500")
    tab.wait_for_function("() => /refused/.test(document.querySelector('.verdict').textContent)")
    tab.fill("[aria-label=Order]", "shape line 40")
    tab.click("text=Send")
    tab.wait_for_function("() => /shape line 40: accepted/.test(document.querySelector('.verdict').textContent)")
    tab.fill("[name=delay_ms]", "300")
    tab.click("text=Apply")
    tab.click('[data-tab="links"]')
    tab.wait_for_function("() => /2\\d\\d|3\\d\\d/.test(document.querySelector('.links tbody tr').textContent)")
    tab.click('[data-tab="orders"]')
    tab.fill("[aria-label=Order]", "loiter")
    tab.click("text=Send")
    tab.wait_for_selector("dialog[open]")  # nothing that ends the flight is sent without a confirmation
    tab.click("dialog button:not([data-confirm])")
    assert tab.inner_text(".state") == "live"
    process.send_signal(signal.SIGKILL)
    tab.wait_for_function("() => document.querySelector('.state').dataset.state === 'killed'")
    tab.evaluate("gcsView.clock.seek(gcsView.store.first_s)")
    tab.wait_for_function("() => Number(document.getElementById('viewer').dataset.time) < gcsView.store.first_s + 1")
