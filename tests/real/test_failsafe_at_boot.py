"""Real autopilots with their ground-station failsafes on take off, in whatever order they and the station come up.

The emulated ones: `tests/flights/test_failsafe_at_boot.py`.
"""

from __future__ import annotations

import os
import signal
import subprocess
import time
from collections.abc import Callable, Generator
from contextlib import AbstractContextManager, ExitStack, contextmanager
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import pytest

from tests.processes import events_of, free_ports, started, wait_for
from tests.real import test_px4
from tests.real.simulators import ARDUCOPTER, ARDUPLANE, PROXY, ArduPilot, at_ports, command_to_fly, running

pytestmark = pytest.mark.slow

COUNT = 2
LONGER_S = 9.0
"""Longer than any of these failsafes but PX4's waits; PX4's is 10 s."""
BOOT_S = 45.0
LIMIT_S = 400.0
PLANES: dict[str, Any] = {
    "formation": {"shape": "line", "spacing_m": 40},
    "path": {"speed_mps": 22, "waypoints_m": [[0, 0, 100], [1500, 0, 100], [3000, 0, 100]]},
}
COPTERS: dict[str, Any] = {
    "formation": {"shape": "line", "spacing_m": 12},
    "path": {"speed_mps": 5, "waypoints_m": [[0, 0, 30], [300, 0, 30], [600, 0, 30]]},
    "safety": {"separation_m": 3, "clearance_m": 5},
}


@dataclass
class Field:
    """A directory with two vehicles, their scenario, and what switches them on and their radio off."""

    directory: Path
    keys: dict[str, Any]
    switch_on: Callable[[ExitStack], None]
    radios: list[subprocess.Popen[bytes]]

    def command(self, *options: str) -> list[str]:
        return command_to_fly(self.directory, self.keys, *options)

    def checked(self) -> bool:
        """Return whether a vehicle's parameters have been judged."""
        return any(each["kind"] == "parameters" for each in events_of(self.directory / "run"))


def ardupilots(kind: ArduPilot, family: str, keys: dict[str, Any], directory: Path) -> Field:
    """Return ArduPilot's vehicles, each behind a proxy, which is its radio."""
    ports = free_ports(2 * COUNT)
    roles = ["leader", *["follower"] * (COUNT - 1)]
    vehicles = [{"id": i, "autopilot": family, "role": role} for i, role in enumerate(roles, 1)]
    field = Field(directory, at_ports({**keys, "vehicles": vehicles}, ports[:COUNT]), lambda _: None, [])

    def switch_on(stack: ExitStack) -> None:
        for listen, to in zip(ports[COUNT:], ports[:COUNT], strict=True):
            proxy = [*PROXY, "--listen", f"udpin:127.0.0.1:{listen}", "--to", f"udpout:127.0.0.1:{to}"]
            (place := directory / f"radio{to}").mkdir()
            field.radios.append(stack.enter_context(running(proxy, place)))
        stack.enter_context(kind.several(ports[COUNT:], directory))

    field.switch_on = switch_on
    return field


def px4s(config: str, directory: Path, *, hovers: bool) -> Field:
    """Return PX4's vehicles, which send to the station's port."""
    keys = test_px4.scenario(COUNT, config)
    keys["vehicles"] = [each | {"endpoint": "udpin:127.0.0.1:14550"} for each in keys["vehicles"]]  # type: ignore[attr-defined]

    def switch_on(stack: ExitStack) -> None:
        for i in range(COUNT):
            instance = test_px4.FIRST_INSTANCE + i
            flying: AbstractContextManager[Any] = test_px4.simulated(instance, directory / f"{i}", hovers=hovers)
            stack.enter_context(flying)

    return Field(directory, keys, switch_on, [])


FIELDS: dict[str, tuple[str, Callable[[Path], Field]]] = {
    "ArduPlane": ("ARDUPLANE_SITL", lambda place: ardupilots(ARDUPLANE, "arduplane", PLANES, place)),
    "ArduCopter": ("ARDUCOPTER_SITL", lambda place: ardupilots(ARDUCOPTER, "arducopter", COPTERS, place)),
    "PX4 fixed wing": ("PX4_SITL", lambda place: px4s("px4", place, hovers=False)),
    "PX4 multirotor": ("PX4_SITL", lambda place: px4s("px4_copter", place, hovers=True)),
}


@contextmanager
def flying(field: Field) -> Generator[subprocess.Popen[str]]:
    with started(field.command("--overwrite")) as station:
        yield station


def station_first(field: Field, stack: ExitStack) -> None:
    stack.enter_context(flying(field))
    time.sleep(3.0)
    field.switch_on(stack)


def vehicles_first(field: Field, stack: ExitStack) -> None:
    field.switch_on(stack)
    time.sleep(BOOT_S)
    stack.enter_context(flying(field))


def station_restarted(field: Field, stack: ExitStack) -> None:
    field.switch_on(stack)
    with flying(field) as first:
        wait_for(field.checked)
        os.kill(first.pid, signal.SIGKILL)
        first.wait(30)
    time.sleep(LONGER_S)
    stack.enter_context(flying(field))


def radio_off_and_on(field: Field, stack: ExitStack) -> None:
    field.switch_on(stack)
    stack.enter_context(flying(field))
    wait_for(field.checked)
    for each in field.radios:
        each.send_signal(signal.SIGSTOP)
    time.sleep(LONGER_S)
    for each in field.radios:
        each.send_signal(signal.SIGCONT)


def dry_run_then_fly(field: Field, stack: ExitStack) -> None:
    field.switch_on(stack)
    done = subprocess.run(field.command("--dry-run"), capture_output=True, text=True, timeout=LIMIT_S, check=False)
    assert done.returncode == 0, done.stderr
    time.sleep(LONGER_S)
    stack.enter_context(flying(field))


ORDERS = (station_first, vehicles_first, station_restarted, radio_off_and_on, dry_run_then_fly)


@pytest.mark.parametrize("order", ORDERS)
@pytest.mark.parametrize("family", FIELDS)
def test_everybody_takes_off_with_the_failsafes_on(
    family: str, order: Callable[[Field, ExitStack], None], tmp_path: Path
) -> None:
    variable, field_in = FIELDS[family]
    if not os.environ.get(variable):
        pytest.skip(f"{variable} isn't set to the path of a SITL binary")
    field = field_in(tmp_path)
    if order is radio_off_and_on and "PX4" in family:
        pytest.skip("their links have no proxy that could be stopped")
    with ExitStack() as stack:
        order(field, stack)
        kinds = {"ready": COUNT, "failure": 1}

        def events(kind: str) -> list[dict[str, Any]]:
            return [each for each in events_of(tmp_path / "run") if each["kind"] == kind]

        wait_for(lambda: any(len(events(kind)) >= count for kind, count in kinds.items()), LIMIT_S)
        assert events("failure") == []
        assert {each["text"] for each in events("ready")} == {"in the air and following setpoints"}
        assert not [each for each in events("parameters") if "FS_" in each["text"] or "NAV_DLL" in each["text"]]
