"""Plans of flights, built step by step; nothing is flown before `fly`."""

from __future__ import annotations

import shlex
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Any, Literal

from formation_scenario import Scenario, load_scenario
from formation_scenario.overrides import settings
from gcs_formation.app.fly import fly
from gcs_formation.app.interrupt import Interrupts
from gcs_formation.app.options import ClockName, RunOptions
from gcs_formation.app.progress import Silent
from gcs_formation.app.run import run
from gcs_formation.record.run_directory import SCENARIO
from gcs_formation.testing.flown import Flown

Against = Literal["emulators", "real endpoints"]
Way = Literal["both", "uplink", "downlink"]
VehicleName = int | str
"""A vehicle's id, or "network:id"."""
Vehicles = VehicleName | Sequence[VehicleName]
"""One or several vehicles, or "all"."""


@dataclass(frozen=True)
class Formation:
    """Creates plans; the value of the fixture `formation`."""

    places: tuple[Path, ...]
    """Where a scenario's relative path is looked for, in this order."""
    directory: Path
    """Where flights are recorded."""

    def __call__(self, scenario: str | Path | Mapping[str, Any] | Scenario, **keys: Any) -> Plan:
        """Plan a flight of a scenario file, of a mapping with a scenario's keys, or of a Scenario.

        `keys` replace the scenario's own, `__` standing for a dot: `law__rate_hz=5`.
        """
        return Plan(self._found(scenario), self.directory).with_keys(**keys)

    def _found(self, scenario: str | Path | Mapping[str, Any] | Scenario) -> Path | Mapping[str, Any] | Scenario:
        if not isinstance(scenario, str | Path):
            return scenario
        candidates = [place / scenario for place in self.places]
        return next((path for path in candidates if path.is_file()), Path(scenario))


@dataclass(frozen=True)
class Plan:
    """A planned flight; each method returns a new plan and leaves this one unchanged."""

    scenario: Path | Mapping[str, Any] | Scenario
    directory: Path
    settings: tuple[str, ...] = ()
    """`dotted.key=value`, as the command's `--set` takes them."""
    link_changes: tuple[Mapping[str, Any], ...] = ()
    opponent: Against = "emulators"
    clock: ClockName = "virtual"
    speedup: float = 1.0

    def with_keys(self, **keys: Any) -> Plan:
        """Replace keys of the scenario, `__` standing for a dot: `with_keys(seed=7, law__rate_hz=5)`."""
        return replace(self, settings=(*self.settings, *settings(keys)))

    def with_link(self, vehicle: Vehicles = "all", *, from_s: float = 0.0, **impairment: Any) -> Plan:
        """Impair the link of one vehicle, several, or all, from a time of the flight on.

        Args:
            vehicle: an id, "network:id", a list of them, or "all".
            from_s: mission time in s; 0: from the very beginning.
            **impairment: the keys of the scenario's `links.changes`: delay_ms, jitter_ms, distribution, loss,
                mean_burst, duplicate, rate_kbps, queue_ms, reorder, outage, trace_file; both ways, or in mappings
                `uplink` (to the vehicle) and `downlink` for one.
        """
        several = vehicle == "all" or not isinstance(vehicle, int | str)
        change = {"at_s": from_s, "vehicles": vehicle if several else [vehicle]} | impairment
        return replace(self, link_changes=(*self.link_changes, change))

    def with_outage(self, vehicle: Vehicles = "all", *, from_s: float, to_s: float, way: Way = "both") -> Plan:
        """Cut the link of one vehicle, several, or all for a while: both ways, to the vehicle, or from it."""
        begins, ends = ({"outage": lost} if way == "both" else {way: {"outage": lost}} for lost in (True, False))
        return self.with_link(vehicle, from_s=from_s, **begins).with_link(vehicle, from_s=to_s, **ends)

    def against(self, opponent: Against) -> Plan:
        """Fly against emulated vehicles, or against "real endpoints": what is up already at the scenario's endpoints.

        The latter is what the command `fly` does: autopilots in a simulator of their own, or real ones; in real time.
        """
        return replace(self, opponent=opponent)

    def in_real_time(self, speedup: float = 1.0) -> Plan:
        """Fly the emulated vehicles over UDP under the machine's clock, `speedup` times faster."""
        return replace(self, clock="real", speedup=speedup)

    def fly(self, until: float | None = None) -> Flown:
        """Fly to the scenario's end or until a mission time in seconds, and return the flown flight.

        Raises:
            ScenarioError: the scenario or what replaces its keys is wrong; nothing was started.
            RunAbortedError: a port is taken, no vehicle answered, a vehicle refused.
        """
        scenario = load_scenario(self.scenario, self.overrides(), option="")
        directory = self._free_directory()
        options = RunOptions(directory, self.clock, self.speedup, until)
        flown = run if self.opponent == "emulators" else fly
        with Interrupts() as interrupts:
            summary = flown(scenario, options, Silent(), interrupts)
        if interrupts.count:
            raise KeyboardInterrupt
        return Flown(scenario, summary, directory, self.command(directory, until))

    def overrides(self) -> tuple[str, ...]:
        """Return all that replaces keys of the scenario, as `--set` takes it."""
        if not self.link_changes:
            return self.settings
        own = load_scenario(self.scenario, self.settings, option="").links.model_dump(exclude_none=True)["changes"]
        return (*self.settings, *settings({"links.changes": [*own, *self.link_changes]}))

    def command(self, directory: Path, until: float | None = None) -> str:
        """Return the command that flies the same once more, for a POSIX shell."""
        words = ["gcs-formation", "run" if self.opponent == "emulators" else "fly"]
        if isinstance(self.scenario, Path):
            words += [_shown(self.scenario)] + [word for each in self.overrides() for word in ("--set", each)]
        else:
            words += [_shown(directory / SCENARIO)]
        if self.opponent == "emulators":
            words += ["--clock", self.clock]
        if self.speedup != 1.0:
            words += ["--speedup", f"{self.speedup:g}"]
        if until is not None:
            words += ["--until", f"{until:g}"]
        return shlex.join(words)

    def _free_directory(self) -> Path:
        number = 1
        while (self.directory / f"flight-{number}").exists():
            number += 1
        return self.directory / f"flight-{number}"


def _shown(path: Path) -> str:
    """Return a path from the working directory where it's inside, else an absolute one."""
    absolute = path.absolute()
    return str(absolute.relative_to(Path.cwd()) if absolute.is_relative_to(Path.cwd()) else absolute)
