"""Plans of flights, built step by step and flown by `fly`."""

from __future__ import annotations

import math
import shlex
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass, replace
from itertools import count
from pathlib import Path
from typing import Any, Literal, get_args

from formation_scenario import Scenario, load_scenario
from formation_scenario.overrides import settings
from formation_scenario.planned_progress import planned_end_s, planned_times_s
from gcs_formation.app.fly import fly
from gcs_formation.app.operator_at_terminal import Interrupts
from gcs_formation.app.progress import Progress
from gcs_formation.app.run import run
from gcs_formation.app.run_options import ClockName, RunOptions
from gcs_formation.record.run_directory import SCENARIO
from gcs_formation.testing.flown_flight import FlownFlight, Vehicles

Against = Literal["emulators", "real endpoints"]
Way = Literal["both", "uplink", "downlink"]
WORDS = {
    "formation.changes": "a change of the formation",
    "path.steps": "a step of the path",
    "links.changes": "a link that changes",
    "disturbances": "a disturbance",
    "orders": "an order",
    "faults": "a fault",
}
"""Names of the planned events under each key."""


@dataclass(frozen=True)
class Formation:
    """Makes plans; the value of the fixture `formation`."""

    places: tuple[Path, ...]
    """Directories in which a scenario's relative path is searched, in this order."""
    directory: Path
    """Directory in which flights are recorded."""

    def __call__(
        self,
        scenario: str | Path | Mapping[str, Any] | Scenario,
        *,
        plugins: Sequence[str | Path] = (),
        **keys: Any,
    ) -> Plan:
        """Plan a flight of a scenario file, of a mapping with a scenario's keys, or of a Scenario.

        `keys` replace the scenario's own; `__` stands for a dot: `law__rate_hz=5`. `plugins`: files of extensions that
        it names, searched as a scenario's file is.
        """
        if isinstance(scenario, str | Path):
            scenario = self._found(scenario)
        found = tuple(self._found(each) for each in plugins)
        return Plan(scenario, self.directory, plugins=found).with_keys(**keys)

    def _found(self, file: str | Path) -> Path:
        """Return where a file is."""
        return next((place / file for place in self.places if (place / file).is_file()), Path(file))


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
    plugins: tuple[Path, ...] = ()

    def with_keys(self, **keys: Any) -> Plan:
        """Replace keys of the scenario; `__` stands for a dot: `with_keys(seed=7, law__rate_hz=5)`."""
        return replace(self, settings=(*self.settings, *settings(keys)))

    def with_link(self, vehicle: Vehicles = "all", *, from_s: float = 0.0, **impairment: Any) -> Plan:
        """Impair the link of one vehicle, several, or all, from a time of the flight on.

        Args:
            vehicle: an id, "network:id", a list of them, or "all".
            from_s: mission time in s; 0: from the very beginning.
            **impairment: the keys of the scenario's `links.changes`: delay_ms, jitter_ms, distribution, loss,
                mean_burst, duplicate, rate_kbps, queue_ms, reorder, outage, trace; both ways, or in mappings
                `uplink` (to the vehicle) and `downlink` for one.
        """
        several = vehicle == "all" or not isinstance(vehicle, int | str)
        change = {"at_s": from_s, "vehicles": vehicle if several else [vehicle]} | impairment
        return replace(self, link_changes=(*self.link_changes, change))

    def with_outage(self, vehicle: Vehicles = "all", *, from_s: float, to_s: float, way: Way = "both") -> Plan:
        """Cut the link of one vehicle, several, or all for a while: both ways, to the vehicle, or from it."""
        if not from_s < to_s:
            raise ValueError(f"found an outage from {from_s:g} s to {to_s:g} s; allowed: one that ends after it begins")
        begins, ends = (
            dict[str, Any]({"outage": lost} if way == "both" else {way: {"outage": lost}}) for lost in (True, False)
        )
        return self.with_link(vehicle, from_s=from_s, **begins).with_link(vehicle, from_s=to_s, **ends)

    def against(self, opponent: Against) -> Plan:
        """Fly against emulated vehicles, or against "real endpoints": vehicles that are up at the scenario's endpoints.

        The latter is what the command `fly` does: autopilots in their own simulator, or real ones; in real time.
        """
        if opponent not in get_args(Against):
            raise ValueError(f"found {opponent!r}; allowed: {', '.join(get_args(Against))}")
        return replace(self, opponent=opponent)

    def in_real_time(self, speedup: float = 1.0) -> Plan:
        """Fly the emulated vehicles over UDP under the machine's clock, `speedup` times faster."""
        return replace(self, clock="real", speedup=speedup)

    def fly(self, until: float | None = None) -> FlownFlight:
        """Fly to the scenario's end or to a mission time in seconds; return the flown flight.

        Raises:
            ScenarioError: the scenario or an override is wrong; nothing was started.
            RunAbortedError: a port is taken, no vehicle answered, a vehicle refused.
            ValueError: something that this plan adds to the scenario, or replaces, would come after the end.
        """
        scenario = load_scenario(self.scenario, self.overrides(), option="", plugins=self.plugins)
        end_s = min(planned_end_s(scenario), math.inf if until is None else until)
        for what, at_s in self._added(scenario):
            if at_s >= end_s:
                raise ValueError(f"found {what} at {at_s:g} s; the flight is over at {end_s:.4g} s")
        numbered = (self.directory / f"flight-{number}" for number in count(1))
        directory = next(path for path in numbered if not path.exists())
        options = RunOptions(directory, self.clock, self.speedup, until)
        flown = run if self.opponent == "emulators" else fly
        with Interrupts() as interrupts:
            summary = flown(scenario, options, Progress(), interrupts)
        if interrupts.count:
            raise KeyboardInterrupt
        return FlownFlight(scenario, summary, directory, self.command(directory, until))

    def overrides(self) -> tuple[str, ...]:
        """Return all overrides of the scenario's keys, as `--set` takes them."""
        if not self.link_changes:
            return self.settings
        loaded = load_scenario(self.scenario, self.settings, option="", plugins=self.plugins)
        own = loaded.links.model_dump(exclude_none=True)["changes"]
        return (*self.settings, *settings({"links.changes": [*own, *self.link_changes]}))

    def _added(self, scenario: Scenario) -> Iterator[tuple[str, float]]:
        """Yield what this plan or its mapping adds, and when, s. What a scenario file plans may be after the end."""
        links = scenario.links.changes
        for key, times_s in planned_times_s(scenario).items():
            for index, at_s in enumerate(times_s):
                with_link = key == "links.changes" and index >= len(links) - len(self.link_changes)
                outlasts = key == "links.changes" and _ends_outage(links[index].model_dump(exclude_none=True))
                if (with_link or self._sets(f"{key}.{index}.")) and not outlasts:
                    yield WORDS[key], at_s

    def _sets(self, key: str) -> bool:
        """Return whether the test wrote an entry of a list: the key itself, or one above or below it."""
        if isinstance(self.scenario, Mapping):
            return True
        names = (f"{setting.partition('=')[0]}." for setting in self.settings)
        return any(name.startswith(key) or key.startswith(name) for name in names)

    def command(self, directory: Path, until: float | None = None) -> str:
        """Return the command that repeats the flight, for a POSIX shell."""
        words = ["gcs-formation", "run" if self.opponent == "emulators" else "fly"]
        if isinstance(self.scenario, Path):
            words += [_shown(self.scenario)] + [word for each in self.overrides() for word in ("--set", each)]
        else:
            words += [_shown(directory / SCENARIO)]
        if self.opponent == "emulators":
            words += ["--clock", self.clock]
        words += [word for file in self.plugins for word in ("--plugin", _shown(file))]
        if self.speedup != 1.0:
            words += ["--speedup", f"{self.speedup:g}"]
        if until is not None:
            words += ["--until", f"{until:g}"]
        return shlex.join(words)


def _ends_outage(change: Mapping[str, Any]) -> bool:
    """Return whether a change only ends an outage, which may as well last to the flight's end."""
    what = {key: change[key] for key in change if key not in {"at_s", "vehicles"}}
    return what == {"outage": False} or all(each == {"outage": False} for each in what.values())


def _shown(path: Path) -> str:
    """Return a path relative to the working directory if it is inside, else an absolute one."""
    absolute = path.absolute()
    return str(absolute.relative_to(Path.cwd()) if absolute.is_relative_to(Path.cwd()) else absolute)
