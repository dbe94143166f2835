"""The page in a real browser, headless and without a network. Skipped if no Chromium is installed."""

from __future__ import annotations

import re
import shutil
import subprocess
from pathlib import Path

import pytest

from formation_scenario import load_scenario
from gcs_formation.report.page import write_report

NAMES = ("chromium", "chromium-browser", "google-chrome", "google-chrome-stable")
BROWSER = next(filter(None, map(shutil.which, NAMES)), None)
OPTIONS = (
    "--headless", "--no-sandbox", "--disable-gpu", "--no-first-run", "--disable-background-networking",
    "--disable-dev-shm-usage", "--host-resolver-rules=MAP * ~NOTFOUND", "--proxy-server=127.0.0.1:9",
    "--enable-logging=stderr", "--virtual-time-budget=3000", "--dump-dom",
)  # fmt: skip
POLICY = """<meta http-equiv="Content-Security-Policy" content="default-src 'none'">"""
"""The report's content security policy; whatever the page would load from elsewhere is an error on the console."""
WALL_S = 120
"""A browser that takes longer counts as hung."""

pytestmark = [
    pytest.mark.slow,
    pytest.mark.skipif(BROWSER is None, reason=f"no browser on this machine: none of {', '.join(NAMES)}"),
]


def opened(page: Path, profile: Path) -> tuple[str, list[str]]:
    """Return the page after its scripts have run, and everything on the browser's console."""
    command = [str(BROWSER), *OPTIONS, f"--user-data-dir={profile}", page.as_uri()]
    done = subprocess.run(command, capture_output=True, text=True, timeout=WALL_S, check=True)
    return done.stdout, re.findall(r"CONSOLE.*", done.stderr)


HILLS = {
    "vehicles": {"count": 4},
    "duration_s": 60,
    "path": {"waypoints_m": [[0, 0, 200], [4000, 0, 200]]},
    "terrain": {"hills": [{"north_m": 900, "east_m": 200, "height_m": 80, "radius_m": 300}]},
}


@pytest.mark.parametrize("scenario", [None, HILLS], ids=["plain", "hills"])
def test_the_report_opens_without_network_and_says_nothing_to_the_console(make_run, tmp_path, scenario):
    run = make_run(load_scenario(scenario) if scenario else None)
    shown, said = opened(write_report(run), tmp_path)
    assert said == []
    assert re.search(r'<output id="clock"[^>]*>[0-9.]+ s</output>', shown), "the scripts ran to their end"
    assert shown.count('aria-pressed="true"') == 4, "a toggle for each vehicle"


AT_ONCE = "<head><script>window.requestAnimationFrame = (draw) => draw(0);</script>"
"""In headless mode, animation frames come late or never."""
HANDS = """<script>
for (const name of ["errors", "plan", "space"]) {
  const canvas = document.getElementById(name);
  const box = canvas.getBoundingClientRect();
  const at = (x, y, more) => ({ clientX: box.left + x, clientY: box.top + y, cancelable: true, ...more });
  const pointer = (kind, x, y) => canvas.dispatchEvent(new PointerEvent(kind, at(x, y, { pointerId: 1 })));
  canvas.setPointerCapture = () => {};
  const pictures = new Set([canvas.toDataURL()]);
  const moves = [["pointerdown", 150, 90], ["pointermove", 230, 130], ["pointerup", 230, 130]];
  moves.forEach((move) => pointer(...move));
  pictures.add(canvas.toDataURL());
  canvas.dispatchEvent(new WheelEvent("wheel", at(150, 90, { deltaY: -300 })));
  pictures.add(canvas.toDataURL());
  document.querySelectorAll("#legend button")[2].click();
  canvas.dataset.pictures = pictures.add(canvas.toDataURL()).size;
}
</script></body>"""


def test_each_plot_answers_to_dragging_the_wheel_and_the_toggles(make_run, tmp_path):
    page = write_report(make_run(load_scenario(HILLS)))
    text = page.read_text(encoding="utf-8").replace("<head>", AT_ONCE, 1).replace("</body>", HANDS)
    page.write_text(text, encoding="utf-8")
    shown, said = opened(page, tmp_path)
    assert said == []
    assert re.findall(r'<canvas id="(\w+)"[^>]*data-pictures="4"', shown) == ["errors", "plan", "space"]


@pytest.mark.parametrize(
    ("body", "expected"),
    [
        ("<script>nowhere();</script>", "nowhere is not defined"),
        (f'{POLICY}<img src="https://example.org/missing.png">', "Content Security Policy"),
    ],
)
def test_an_error_would_be_seen(tmp_path, body, expected):
    page = tmp_path / "broken.html"
    page.write_text(f"<!DOCTYPE html><title>broken</title>{body}")
    said = opened(page, tmp_path / "profile")[1]
    assert any(expected in line for line in said)
