"""The README's pictures of the page: an animation of the quickstart, and the page in light and dark.

`python -m benchmarks.pictures [--run RUN_DIR] [--to docs]` flies `configs/quickstart.yaml` on the virtual clock (or
takes a finished run of it), opens it in a headless Chromium of the distribution, and writes `docs/quickstart.gif` (at
most 2 MiB), `docs/page-light.png` and `docs/page-dark.png`. Playwright drives it: pip install '.[browser]'.
"""

from __future__ import annotations

import argparse
import io
import tempfile
from pathlib import Path
from typing import Any

from PIL import Image

import gcs_formation
from benchmarks.page import browser, viewer

ROOT = Path(__file__).parents[1]
MAX_BYTES = 2 * 2**20
FRAMES, FROM_S, TO_S = 56, 0.0, 112.0
"""Frames of the animation, and the mission time that they show, s."""
FRAME_MS = 110
COLOURS = 64
SCENARIO = ROOT / "configs" / "quickstart.yaml"
CHANGES = {
    "formation.changes": [{"at_s": 30, "shape": "line"}, {"at_s": 70, "shape": "diamond"}],
    "links.default": {"delay_ms": 150, "jitter_ms": 10, "loss": 0.03},
}
READY = "#viewer[data-ready]"


def shown(page: Any, time_s: float) -> None:  # noqa: ANN401 - Playwright's, which need not be installed
    """Show a mission time, and wait until it is drawn."""
    page.evaluate(f"gcsView.clock.playing = false; gcsView.clock.seek(gcsView.store.zero_s + {time_s})")
    page.wait_for_function("() => !gcsView.asking")
    page.wait_for_timeout(120)


def still(page: Any, address: str, scheme: str, file: Path) -> None:  # noqa: ANN401
    """Write a picture of the page."""
    page.emulate_media(color_scheme=scheme)
    page.goto(address)
    page.wait_for_selector(READY)
    shown(page, 44.0)
    page.evaluate("gcsView.choose('links'); gcsView.plots.window_s = 60")
    page.wait_for_timeout(1200)
    page.screenshot(path=str(file))


def animation(page: Any, address: str, file: Path) -> None:  # noqa: ANN401
    """Write the plan of the flight as an animation, with as many colours as fit."""
    page.emulate_media(color_scheme="light")
    page.goto(address)
    page.wait_for_selector(READY)
    page.evaluate("document.querySelector('.tools').style.display = 'none'")
    frames = list[Image.Image]()
    for number in range(FRAMES):
        shown(page, FROM_S + (TO_S - FROM_S) * number / (FRAMES - 1))
        data = page.locator(".view").screenshot()
        frames.append(Image.open(io.BytesIO(data)).convert("RGB"))
    for colours in (COLOURS, COLOURS // 2, COLOURS // 4):
        palette = frames[FRAMES // 2].quantize(colours)
        drawn = [each.quantize(colours, palette=palette, dither=Image.Dither.NONE) for each in frames]
        drawn[0].save(file, save_all=True, append_images=drawn[1:], duration=FRAME_MS, loop=0, optimize=True)
        if file.stat().st_size <= MAX_BYTES:
            return
    raise SystemExit(f"{file} has {file.stat().st_size} bytes; allowed: {MAX_BYTES}")


def main() -> None:
    """Fly, and write the pictures."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--run", type=Path)
    parser.add_argument("--to", type=Path, default=ROOT / "docs")
    given = parser.parse_args()
    with tempfile.TemporaryDirectory() as temporary:
        run = given.run
        if run is None:
            run = Path(temporary) / "quickstart"
            gcs_formation.run(SCENARIO, clock="virtual", out=run, overrides=CHANGES)
        with viewer(run) as address:
            with browser((1280, 760)) as page:
                for scheme in ("light", "dark"):
                    still(page, address, scheme, given.to / f"page-{scheme}.png")
            with browser((900, 640)) as page:
                animation(page, address, given.to / "quickstart.gif")
    for name in ("page-light.png", "page-dark.png", "quickstart.gif"):
        print(name, (given.to / name).stat().st_size)


if __name__ == "__main__":
    main()
