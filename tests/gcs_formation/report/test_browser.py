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
    assert 'data-ready="true"' in shown, "the scripts ran to their end"
    assert len(re.findall(r'<li class="card" data-vehicle="\d"', shown)) == 4, "a card for each vehicle"


HANDS = """<script>
setTimeout(async () => {
  const place = document.getElementById("viewer");
  const picture = (canvas) => { gcsView.draw(performance.now()); return canvas.toDataURL(); };
  const use = (canvas) => {
    const box = canvas.getBoundingClientRect();
    const at = (x, y, more) => ({ clientX: box.left + x, clientY: box.top + y, cancelable: true, ...more });
    const moves = [["pointerdown", 150, 90], ["pointermove", 190, 110], ["pointermove", 230, 130]];
    canvas.setPointerCapture = () => {};
    const pictures = new Set([picture(canvas)]);
    for (const [kind, x, y] of moves) canvas.dispatchEvent(new PointerEvent(kind, at(x, y, { pointerId: 1 })));
    pictures.add(picture(canvas));
    canvas.dispatchEvent(new WheelEvent("wheel", at(150, 90, { deltaY: -300 })));
    pictures.add(picture(canvas));
    gcsView.clock.seek(gcsView.store.first_s + 20);
    return pictures.add(picture(canvas)).size;
  };
  place.dataset.plan = use(document.querySelector("canvas.plan"));
  await gcsView.toggleSpace();
  place.dataset.space = gcsView.space.ready;
}, 1500);
</script></body>"""


def test_the_plan_answers_to_dragging_the_wheel_and_the_time(make_run, tmp_path):
    page = write_report(make_run(load_scenario(HILLS)))
    page.write_text(page.read_text(encoding="utf-8").replace("</body>", HANDS), encoding="utf-8")
    shown, said = opened(page, tmp_path)
    assert [line for line in said if "software WebGL" not in line and "GPU" not in line] == []
    assert 'data-plan="4"' in shown
    assert 'data-space="true"' in shown


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
