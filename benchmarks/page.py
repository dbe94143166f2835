"""How the page keeps up: N vehicles at 10 Hz in a headless browser; loading and seeking; what it costs the station.

`python -m benchmarks.page [--vehicles N] [--seconds S] [--speedup X] [--size WxH]`: a made-up flight is written as a
station writes it, tick by tick, while a Chromium on the same machine shows it by software rendering. `--load`: a
finished flight of `--seconds` is loaded and sought in instead. `--ticks`: a tick's processor time with and without.
Playwright drives the browser: pip install '.[browser]'.
"""

from __future__ import annotations

import argparse
import json
import subprocess
import sys
import tempfile
import time
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path
from typing import Any

import numpy as np

from airlink.host_system import lock
from flight_model.arrays import Array
from formation_scenario import dump_scenario, load_scenario
from gcs_formation.app.operator_at_terminal import Interrupts
from gcs_formation.app.progress import Progress
from gcs_formation.app.run import run
from gcs_formation.app.run_options import RunOptions
from gcs_formation.record.parquet import write_parquet
from gcs_formation.record.run_directory import EVENTS, SCENARIO, SPOOL, SUMMARY, TIMESERIES
from gcs_formation.record.timeseries import GAINS, MIXED, PHASES, SPOOLED

RATE_HZ = 10.0
BROWSERS = ("/usr/bin/chromium", "/usr/bin/chromium-browser", "/usr/bin/google-chrome")
FLAGS = (
    *("--no-sandbox", "--disable-gpu", "--disable-quic", "--no-first-run"),
    *("--disable-background-networking", "--disable-component-update", "--disable-sync"),
    *("--enable-precise-memory-info", "--js-flags=--expose-gc"),
)


def rows(vehicles: int, first: int, count: int) -> Array:
    """Return made-up ticks (count, vehicles, values): a grid of vehicles on a wide circle, each with some error."""
    t_s = (first + np.arange(count))[:, np.newaxis] / RATE_HZ
    side = int(np.ceil(np.sqrt(vehicles)))
    column, row = np.arange(vehicles) % side, np.arange(vehicles) // side
    turn = 0.01 * t_s
    error = 0.5 * np.sin(0.3 * t_s + np.arange(vehicles))
    found = dict.fromkeys(SPOOLED, np.zeros((count, vehicles)))
    heading = np.broadcast_to(np.pi / 2 + turn, (count, vehicles))
    cos, sin = np.cos(heading), np.sin(heading)
    forward, right = (
        np.where(np.arange(vehicles), -30.0 * row, np.nan),
        np.where(np.arange(vehicles), 30.0 * column, np.nan),
    )
    ahead, right = -30.0 * row + error, 30.0 * column - error
    found |= {
        "phase": np.full((count, vehicles), float(PHASES.index("flying"))),
        "t_s": np.broadcast_to(t_s, (count, vehicles)),
        "mission_time_s": np.broadcast_to(t_s, (count, vehicles)),
        "north_m": 2000 * np.sin(turn) + ahead * cos - right * sin,
        "east_m": 2000 * (1 - np.cos(turn)) + ahead * sin + right * cos,
        "height_m": 100.0 + 5.0 * np.sin(0.05 * t_s + np.arange(vehicles)),
        "airspeed_mps": np.full((count, vehicles), 20.0),
        "heading_rad": heading,
        "slot_forward_m": np.broadcast_to(forward, (count, vehicles)),
        "slot_right_m": np.broadcast_to(right, (count, vehicles)),
        "law_error_x_m": -error,
        "law_error_y_m": error,
        "delay_s": 0.1 + 0.02 * np.sin(t_s + np.arange(vehicles)),
        "age_s": np.full((count, vehicles), 0.1),
        "margin_used": 0.3 + 0.1 * np.sin(t_s + np.arange(vehicles)),
        "active": np.ones((count, vehicles)),
        "airborne": np.ones((count, vehicles)),
        "leads": np.broadcast_to(np.arange(vehicles) == 0, (count, vehicles)).astype(np.float64),
    }
    assert set(found) == set(SPOOLED), set(MIXED + GAINS) - set(found)
    return np.stack([found[name] for name in SPOOLED], axis=-1)


def begin(directory: Path, vehicles: int) -> None:
    """Write what a run's directory begins with."""
    keys = {
        "schema": 1, "name": f"{vehicles} vehicles", "vehicles": {"count": vehicles}, "start": {"in_air": True},
        "formation": {"shape": "line", "spacing_m": 30},
        "path": {"speed_mps": 20, "waypoints_m": [[0, 0, 100], [2000, 2000, 100]]},
    }  # fmt: skip
    directory.mkdir(parents=True, exist_ok=True)
    file = directory / SCENARIO
    file.write_text(json.dumps(keys))
    file.write_text(dump_scenario(load_scenario(file, flown=True)))
    head = {"vehicles": [[1, each + 1] for each in range(vehicles)], "values": list(SPOOLED)}
    (directory / SPOOL).write_bytes(json.dumps(head).encode() + b"\n")
    line = {"schema": 1, "t_s": 0.0, "kind": "phase", "text": "flying", "cause": "a benchmark"}
    (directory / EVENTS).write_text(json.dumps(line) + "\n")


def finish(directory: Path, vehicles: int, seconds: float) -> None:
    """Write a finished flight's time series."""
    count = round(seconds * RATE_HZ)
    table = rows(vehicles, 0, count)
    columns = {name: np.ascontiguousarray(table[:, :, at]) for at, name in enumerate(SPOOLED)}
    columns |= {"network": np.ones((count, vehicles)), "vehicle": np.tile(np.arange(1.0, vehicles + 1), (count, 1))}
    write_parquet(directory / TIMESERIES, [columns])
    (directory / SUMMARY).write_text("{}")
    (directory / SPOOL).unlink()


@contextmanager
def viewer(directory: Path) -> Iterator[str]:
    """Yield the address of a viewer's process."""
    command = [sys.executable, "-m", "gcs_formation", "view", str(directory)]
    with subprocess.Popen(command, stdout=subprocess.PIPE, stderr=subprocess.DEVNULL, text=True) as process:
        try:
            assert process.stdout is not None
            yield process.stdout.readline().split()[1]
        finally:
            process.terminate()


@contextmanager
def browser(size: tuple[int, int]) -> Iterator[Any]:
    """Yield a page of a headless Chromium of the distribution."""
    from playwright.sync_api import sync_playwright  # noqa: PLC0415 - only this needs it

    path = next(each for each in BROWSERS if Path(each).exists())
    with sync_playwright() as driver:
        opened = driver.chromium.launch(executable_path=path, args=list(FLAGS))
        yield opened.new_page(viewport={"width": size[0], "height": size[1]})
        opened.close()


def measure_live(
    directory: Path, vehicles: int, seconds: float, speedup: float, size: tuple[int, int] = (1280, 800)
) -> dict[str, float]:
    """Return frames a second, and the browser's memory after a fifth of the time and at the end, MB."""
    found = dict[str, float]()
    with (directory / EVENTS).open("a") as locked, (directory / SPOOL).open("ab") as spool:
        lock(locked)
        spool.write(rows(vehicles, 0, 50).tobytes())
        spool.flush()
        with viewer(directory) as address, browser(size) as page:
            page.goto(address)
            page.wait_for_selector("#viewer[data-ready]")
            began, ticks, frames, settled = time.monotonic(), 50, 0, False
            while (spent := time.monotonic() - began) < seconds:
                due = 50 + int(spent * RATE_HZ * speedup)
                if due > ticks:
                    spool.write(rows(vehicles, ticks, due - ticks).tobytes())
                    spool.flush()
                    ticks = due
                if not settled and spent > seconds / 5:
                    settled, frames = True, page.evaluate("gcsView.frames")
                    since, found["heap_early_mb"] = time.monotonic(), _heap_mb(page)
                time.sleep(1.0 / RATE_HZ / 2)
            spent = time.monotonic() - since
            found["frames_per_s"] = (page.evaluate("gcsView.frames") - frames) / spent
            found["heap_end_mb"], found["flown_s"] = _heap_mb(page), ticks / RATE_HZ
            found["behind_s"] = ticks / RATE_HZ - float(page.evaluate("gcsView.store.last_s"))
    return found


def _heap_mb(page: Any) -> float:  # noqa: ANN401 - Playwright's, which need not be installed
    used: float = page.evaluate("(gc(), performance.memory.usedJSHeapSize)")
    return used / 1e6


def measure_load(directory: Path) -> dict[str, float]:
    """Return the time until the page shows a finished flight, and the longest of five seeks."""
    with viewer(directory) as address, browser((1280, 800)) as page:
        began = time.monotonic()
        page.goto(address)
        page.wait_for_selector("#viewer[data-ready]")
        loaded_s = time.monotonic() - began
        seek = """async (share) => {
            const s = gcsView.store, at = s.first_s + share * (s.last_s - s.first_s), t = performance.now();
            gcsView.detailed = null; gcsView.clock.playing = false; gcsView.clock.seek(at);
            while (gcsView.asking || !gcsView.detailed) await new Promise((done) => setTimeout(done, 5));
            return performance.now() - t; }"""
        page.wait_for_timeout(500)
        return {
            "load_s": loaded_s,
            "seek_s": max(page.evaluate(seek, share) for share in (0.1, 0.9, 0.3, 0.7, 0.5)) / 1e3,
        }


def measure_ticks(directory: Path, flights: int = 5) -> dict[str, float]:
    """Return the processor time of a tick, ms, without and with a record that somebody may look at.

    The same flight in turns under the virtual clock, the least of each: nothing else of the station knows of the page.
    """
    keys = ("start={in_air: true, run_in_s: 6}", "vehicles={count: 6}")
    scenario = load_scenario(Path(__file__).parents[1] / "configs" / "quickstart.yaml", keys)
    spent = dict[str, list[float]](without_ms=[], with_ms=[])
    for _ in range(flights):
        for name, recording in (("without_ms", None), ("with_ms", _no_viewer)):
            options = RunOptions(directory, "virtual", until_s=20.0, overwrite=True, recording=recording)
            began_s = time.process_time()
            ticks = run(scenario, options, Progress(), Interrupts()).to_dict()["control"]["ticks"]
            spent[name].append(1e3 * (time.process_time() - began_s) / ticks)
    return {name: min(each) for name, each in spent.items()}


def _no_viewer() -> None:
    """Take note that the record is open."""


def main() -> None:
    """Measure and print."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--vehicles", type=int, default=100)
    parser.add_argument("--seconds", type=float, default=30.0, help="wall time; with --load: of the flight")
    parser.add_argument("--speedup", type=float, default=1.0)
    parser.add_argument("--size", default="1280x800", help="of the browser's window, pixels")
    parser.add_argument("--load", action="store_true")
    parser.add_argument("--ticks", action="store_true", help="what a record that is looked at costs the station")
    given = parser.parse_args()
    with tempfile.TemporaryDirectory() as temporary:
        directory = Path(temporary) / "run"
        if given.ticks:
            print(json.dumps(measure_ticks(directory)))
            return
        begin(directory, given.vehicles)
        if given.load:
            finish(directory, given.vehicles, given.seconds)
            found = measure_load(directory)
        else:
            width, _, height = given.size.partition("x")
            found = measure_live(directory, given.vehicles, given.seconds, given.speedup, (int(width), int(height)))
    print(json.dumps({name: round(value, 3) for name, value in found.items()}))


if __name__ == "__main__":
    main()
