"""A signed flight in real time behind a proxy that records: what it plays again is refused, and counted."""

from __future__ import annotations

import json
import subprocess
import threading
from collections.abc import Generator
from contextlib import ExitStack
from pathlib import Path
from typing import Any

import pytest
import yaml

from airlink.clock import Instant
from airlink.endpoint import Address, Endpoint
from airlink.impairment import Direction
from airlink.proxy import Proxy
from airlink.relay import Passage, Relay
from airlink.signing.key import write_new_key
from airlink.signing.signature import is_signed, unsigned
from tests.flights.conftest import scenario
from tests.processes import LIMIT_S, STATION, VEHICLES, free_ports, started

LATER = 25
"""Datagrams after which a datagram is played again."""


class Recording(Relay):
    """A relay that plays what has passed again: as it was, altered, and without its signature."""

    def __init__(self) -> None:
        super().__init__(1)
        self.passed: dict[Direction, list[Passage]] = {way: [] for way in Direction}
        self.forged = dict.fromkeys(Direction, 0)

    def accept(self, passage: Passage, now: Instant) -> None:
        """Pass a datagram on, and then forge another."""
        super().accept(passage, now)
        remote, way, data = passage
        passed = self.passed[way]
        passed.append(passage)
        if len(passed) > LATER and is_signed(data):
            old, kind = passed[-LATER][2], len(passed) % 3
            altered = old[:-1] + bytes((old[-1] ^ 1,))
            self.forged[way] += 1
            super().accept((remote, way, (old, altered, unsigned(old))[kind]), now)


@pytest.fixture
def proxies() -> Generator[list[tuple[int, int, Recording]]]:
    """Return, for each of three vehicles, the port that it sends to, the station's, and what goes between."""
    over, threads, found = threading.Event(), list[threading.Thread](), list[tuple[int, int, Recording]]()
    with ExitStack() as stack:
        for _ in range(3):
            near, far = free_ports(2)
            relay = Recording()
            here, there = (Address("127.0.0.1", port) for port in (near, far))
            proxy = stack.enter_context(Proxy(Endpoint("udpin", here), Endpoint("udpout", there), relay))
            threads.append(threading.Thread(target=proxy.run, args=(over.is_set,)))
            found.append((near, far, relay))
        for each in threads:
            each.start()
        yield found
        over.set()
        for each in threads:
            each.join()


@pytest.mark.slow
def test_what_a_recording_proxy_plays_again_changes_nothing_and_is_counted(
    proxies: list[tuple[int, int, Recording]], tmp_path: Path
) -> None:
    write_new_key(tmp_path / "link.key")
    links = {"default": {"signing": {"key_file": "link.key"}}}

    def vehicles(column: int) -> list[dict[str, Any]]:
        ends = [f"udpin:127.0.0.1:{ports[column]}" for ports in proxies]
        return [{"id": number, "endpoint": end} for number, end in enumerate(ends, 1)]

    files = tmp_path / "vehicles.yaml", tmp_path / "station.yaml"
    for column, file in enumerate(files):
        first, *others = vehicles(column)
        begins = {"in_air": True, "run_in_s": 16}
        keys = scenario(duration_s=8, start=begins, links=links, vehicles=[{**first, "role": "leader"}, *others])
        file.write_text(yaml.safe_dump(keys))
    out = tmp_path / "run"
    with started([*VEHICLES, files[0], "--quiet"]):
        command: list[str | Path] = [*STATION, "fly", files[1], "--out", out, "--quiet"]
        subprocess.run(command, check=True, timeout=LIMIT_S)
    summary = json.loads((out / "summary.json").read_text())
    for number, (_, _, relay) in enumerate(proxies, 1):
        link, forged = summary["links"][str(number)], relay.forged[Direction.DOWNLINK]
        assert link["authenticated"] is True
        # Some pass after the station's end.
        assert forged - 100 <= link["frames_refused"] <= forged
        assert link["frames_refused"] > 300
        assert set(link["refused"]) == {"replayed", "wrong_key", "unsigned"}
        assert link["measured_loss"] < 0.02
        assert relay.forged[Direction.UPLINK] > 100
    for follower in summary["followers"].values():
        assert max(follower[f"error_{axis}_m"]["rms"] for axis in "xyz") < 0.1
    assert (tmp_path / "link.key.timestamps").is_file()
    assert summary["unsafe"] == []
