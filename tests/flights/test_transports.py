"""The same flight over links of every kind: in memory, and over real sockets and pseudo-terminals."""

from __future__ import annotations

import json
import os
import pty
import select
import subprocess
import threading
import tty
from collections.abc import Callable, Generator
from pathlib import Path
from typing import Any

import pytest
import yaml

from tests.flights.conftest import Fly, scenario
from tests.processes import LIMIT_S, STATION, VEHICLES, free_ports, started

OVER: dict[str, Callable[[int], str]] = {
    "tcp": lambda number: f"tcp:127.0.0.1:{5760 + 10 * number}",
    "one tcpin": lambda _: "tcpin:127.0.0.1:5760",
    "IPv6": lambda number: f"udpin:[::1]:{14550 + number}",
    "serial lines": lambda number: f"serial:/dev/ttyUSB{number}:57600",
    "one serial line": lambda _: "/dev/ttyUSB0",
    "multicast": lambda _: "mcast:",
}
OFTEN = {"tcp", "one serial line"}
"""What a push flies; the night flies the others."""
COUNT = 3
START = {"in_air": True, "run_in_s": 8}


def at(endpoint: Callable[[int], str], **keys: Any) -> dict[str, Any]:
    """Return a scenario with a leader and two followers at these endpoints."""
    first, *others = ({"id": number, "endpoint": endpoint(number)} for number in range(1, COUNT + 1))
    return scenario(vehicles=[{**first, "role": "leader"}, *others], **keys)


def errors_m(figures: dict[str, Any]) -> list[float]:
    return [each[f"error_{axis}_m"]["rms"] for each in figures["followers"].values() for axis in "xyz"]


@pytest.mark.parametrize(
    "over", [each if each in OFTEN else pytest.param(each, marks=pytest.mark.slow) for each in OVER]
)
def test_the_formation_flies_the_same_over_every_kind_of_link(fly: Fly, over: str) -> None:
    by_udp = fly(**at(lambda number: f"udpin:127.0.0.1:{14550 + number}", duration_s=3)).to_dict()
    flown = fly(**at(OVER[over], duration_s=3)).to_dict()
    assert errors_m(flown) == pytest.approx(errors_m(by_udp), abs=1e-9)
    assert [each["measured_loss"] for each in flown["links"].values()] == [0.0] * COUNT


class Lines:
    """Serial lines: pairs of pseudo-terminals, joined until they are cut."""

    def __init__(self, count: int) -> None:
        self.cut, self._over = threading.Event(), threading.Event()
        self.ends, self._to, self._kept = list[tuple[str, str]](), dict[int, int](), list[int]()
        for _ in range(count):
            (far, far_device), (near, near_device) = pty.openpty(), pty.openpty()
            for each in (far, far_device, near, near_device):
                tty.setraw(each)
            self._to |= {far: near, near: far}
            self._kept += [far, far_device, near, near_device]
            self.ends.append((os.ttyname(near_device), os.ttyname(far_device)))
        self._thread = threading.Thread(target=self._carry)
        self._thread.start()

    def _carry(self) -> None:
        poll = select.poll()
        for each in self._to:
            poll.register(each, select.POLLIN)
        while not self._over.is_set():
            for each, _ in poll.poll(100):
                data = os.read(each, 4096)
                if not self.cut.is_set():
                    os.write(self._to[each], data)

    def close(self) -> None:
        self._over.set()
        self._thread.join()
        for each in self._kept:
            os.close(each)


@pytest.fixture
def lines(request: pytest.FixtureRequest) -> Generator[Lines]:
    found = Lines(request.param)
    yield found
    found.close()


def flown(keys: dict[str, Any], directory: Path, ends: tuple[str, ...] = ()) -> dict[str, Any]:
    """Fly vehicles in a process of their own, with these ends of their links; return the summary."""
    file, out = directory / "scenario.yaml", directory / "run"
    file.write_text(yaml.safe_dump(keys))
    options = [option for each in ends for option in ("--endpoint", each)]
    with started([*VEHICLES, file, *options, "--quiet"]):
        subprocess.run([*STATION, "fly", file, "--out", out, "--overwrite", "--quiet"], check=True, timeout=LIMIT_S)
    found: dict[str, Any] = json.loads((out / "summary.json").read_text())
    return found


@pytest.mark.slow
@pytest.mark.parametrize("lines", [COUNT, 1], indirect=True)
def test_over_serial_lines_errors_are_those_over_udp(lines: Lines, tmp_path: Path) -> None:
    """A line for each, and one for all: within 20 % or 1 cm."""
    ports = free_ports(COUNT)
    by_udp = flown(at(lambda number: f"udpin:127.0.0.1:{ports[number - 1]}", start=START, duration_s=10), tmp_path)
    ends = [lines.ends[number % len(lines.ends)] for number in range(COUNT)]
    keys = at(lambda number: f"serial:{ends[number - 1][0]}:57600", start=START, duration_s=10)
    by_line = flown(keys, tmp_path, tuple(f"{number + 1}=serial:{end}:57600" for number, (_, end) in enumerate(ends)))
    for own_m, udp_m in zip(errors_m(by_line), errors_m(by_udp), strict=True):
        assert own_m <= max(1.2 * udp_m, udp_m + 0.01)


@pytest.mark.slow
@pytest.mark.parametrize("lines", [1], indirect=True)
def test_a_line_that_is_cut_for_five_seconds_is_an_outage(lines: Lines, tmp_path: Path) -> None:
    near, far = lines.ends[0]
    cuts = [threading.Timer(12.0, lines.cut.set), threading.Timer(17.0, lines.cut.clear)]
    for each in cuts:
        each.start()
    flown(at(lambda _: f"serial:{near}:57600", start=START, duration_s=15), tmp_path, (f"all=serial:{far}:57600",))
    events = [json.loads(line) for line in (tmp_path / "run" / "events.jsonl").read_text().splitlines()]
    links = [each["text"] for each in events if each["kind"] == "link" and each["vehicle"] == "2"]
    assert links[:2] == ["connected", "stale"]
    assert links[-1] == "connected"
