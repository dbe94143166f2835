"""What the modules of a run register, together: loading them, finding a name among it, passing it to other processes.

The modules are those of installed packages with an entry point in the group `gcs_formation.extensions`, and files given
with `--plugin`. What they register belongs to the run that named them: a `Registry` travels with its scenario, to other
processes by the files' content.
"""

from __future__ import annotations

import hashlib
import json
import sys
from collections.abc import Callable, Iterable, Iterator, Mapping, Sequence
from functools import lru_cache, partial
from importlib.abc import SourceLoader
from importlib.metadata import EntryPoint, entry_points
from importlib.util import module_from_spec, spec_from_loader
from pathlib import Path
from typing import Any, TypeAlias

from formation_scenario.expectation import METRICS
from formation_scenario.extensions import (
    AIRCRAFT,
    AUTOPILOT,
    DELAY_ESTIMATOR,
    DISTURBANCE,
    EMULATED_FAMILY,
    FAULT,
    FILTER,
    GUIDANCE,
    LAW,
    LAW_KINDS,
    LINK,
    METRIC,
    NAVIGATION,
    OPTION,
    PREDICTOR,
    SWITCHED,
    Origin,
    Registered,
    line_in,
    registered_of,
)
from formation_scenario.fields import did_you_mean, refused
from formation_scenario.formation import SHAPE_NAMES
from formation_scenario.law import LAW_TYPES, PREDICTORS
from formation_scenario.links import NO_PROCESS
from formation_scenario.navigation import NAVIGATIONS
from formation_scenario.path_plan import GUIDANCES
from formation_scenario.register import MARKS
from formation_scenario.shapes import SHAPE
from formation_scenario.shipped_aircraft import shipped_names
from formation_scenario.surroundings import DISTURBANCES, FAULTS
from formation_scenario.vehicles import AUTOPILOTS, CLOCKS, FAMILIES

GROUP = "gcs_formation.extensions"
"""The group of entry points of installed packages."""
RECORD = "extensions.json"
"""The file of a run directory that says which extensions were used."""
OURS: Mapping[str, tuple[str, ...]] = {
    LAW: LAW_TYPES,
    METRIC: tuple(METRICS),
    SHAPE: SHAPE_NAMES,
    PREDICTOR: PREDICTORS,
    DELAY_ESTIMATOR: CLOCKS,
    GUIDANCE: GUIDANCES,
    AUTOPILOT: AUTOPILOTS,
    LINK: (NO_PROCESS,),
    FAULT: FAULTS,
    DISTURBANCE: DISTURBANCES,
    EMULATED_FAMILY: FAMILIES,
    NAVIGATION: NAVIGATIONS,
}
"""Names that are taken already, by kind."""
HOW = f"{OPTION} FILE.py, or an installed package that registers it"
Files: TypeAlias = "Sequence[str | Path]"


class Registry:
    """Everything that the modules of a run register. It is pickled by content, and equal by content."""

    def __init__(self, found: Iterable[Registered] = ()) -> None:
        """Take what is registered.

        Raises:
            ScenarioError: a name is taken twice.
        """
        self._each = tuple(found)
        if not self._each:
            return
        ours = {**OURS, AIRCRAFT: shipped_names()}
        taken = {(_namespace(kind), name): "gcs_formation itself" for kind, names in ours.items() for name in names}
        for one in self._each:
            namespaced = _namespace(one.kind), one.name
            if namespaced in taken:
                raise refused(f"{one}", f"found twice: {taken[namespaced]} and {one.where}", "each name once")
            taken[namespaced] = one.where
        for one in self._each:
            if one.kind == METRIC and (FILTER, one.name) in taken:
                raise refused(f"{one}", f"found twice: {taken[FILTER, one.name]} and {one.where}", "each name once")

    @property
    def origins(self) -> tuple[Origin, ...]:
        """The modules, in the order in which they were named."""
        return tuple(dict.fromkeys(one.origin for one in self._each))

    @property
    def files(self) -> tuple[str, ...]:
        """The files among them, which another command needs named."""
        return tuple(origin.file for origin in self.origins if origin.content is not None)

    def get(self, name: str | None, *kinds: str) -> Registered | None:
        """Return what is registered by a name, of one of the kinds."""
        return next((one for one in self._each if one.name == name and one.kind in kinds), None)

    def names(self, *kinds: str) -> list[str]:
        """Return the names of all things of some kinds."""
        return [one.name for one in self._each if one.kind in kinds]

    def of(self, *kinds: str) -> list[Registered]:
        """Return all things of some kinds."""
        return [one for one in self._each if one.kind in kinds]

    def __iter__(self) -> Iterator[Registered]:
        return iter(self._each)

    def __bool__(self) -> bool:
        return bool(self._each)

    def __eq__(self, other: object) -> bool:
        return isinstance(other, Registry) and self.origins == other.origins

    def __hash__(self) -> int:
        return hash(self.origins)

    def __reduce__(self) -> tuple[Any, ...]:
        """Pickle the modules by content; installed packages by name, version and hash."""
        return _restored, (self.origins,)


def _namespace(kind: str) -> str:
    """Return the kind within which a name is taken once: `law.type` names both kinds of laws, `extensions` three."""
    return LAW if kind in LAW_KINDS else FILTER if kind in SWITCHED else kind


def load_extensions(plugins: Files | Registry = ()) -> Registry:
    """Return what installed packages and some files register; a `Registry` as it is.

    Raises:
        ScenarioError: a file can't be read or executed, registers nothing, or a name is taken twice.
    """
    if isinstance(plugins, Registry):
        return plugins
    found = [one for entry in _entry_points() for one in _installed(entry)]
    for path in dict.fromkeys(Path(plugin).absolute() for plugin in plugins):
        try:
            content = path.read_bytes()
        except OSError as error:
            raise refused("", error.strerror or str(error), "a Python file", f"{OPTION} {path}") from error
        found += _of_file(Origin(str(path), hashlib.sha256(content).hexdigest(), content))
    unique = dict[type[Any], Registered]()
    for one in found:
        unique.setdefault(one.made, one)
    return Registry(unique.values())


def missing(name: str, directory: Path | None) -> str:
    """Return how the extension of a recorded run, beside whose run.yaml this is, can be named; "" if it isn't one."""
    try:
        flown: list[dict[str, Any]] = (
            json.loads((directory / RECORD).read_text("utf-8")) if directory is not None else []
        )
        found = [_how(each) for each in flown if each["name"] == name]
    except (OSError, ValueError, KeyError, TypeError):
        return ""
    return f"; it was flown with {found[0]}" if found else ""


def _how(recorded: Mapping[str, Any]) -> str:
    named = f"the package {recorded['package']} {recorded['version']}"
    where = f"{OPTION} {recorded['file']}" if recorded["package"] is None else named
    return f"{where} (sha256 {recorded['sha256'][:12]})"


def unknown(name: str, known: Sequence[str]) -> str:
    """Return in words what is allowed in place of a name that nothing is registered by."""
    return f"{', '.join(known)}{did_you_mean(name, known)}" if known else f"none without {HOW}"


def _restored(origins: tuple[Origin, ...]) -> Registry:
    """Return the registry of modules that another process sent.

    Raises:
        ScenarioError: an installed package isn't the same here.
    """
    found = list[Registered]()
    for origin in origins:
        if origin.content is not None:
            found += _of_file(origin)
            continue
        same = [
            one
            for entry in _entry_points()
            if entry.value == origin.entry_point
            for one in _installed(entry)
            if one.origin.sha256 == origin.sha256
        ]
        if not same:
            raise refused("", f"found no {origin.package} {origin.version} here", origin.how)
        found += same
    return Registry(found)


class _Content(SourceLoader):
    """Loads a module from the content of a file, wherever that is."""

    def __init__(self, file: str, content: bytes) -> None:
        self._file, self._content = file, content

    def get_filename(self, fullname: str) -> str:
        del fullname
        return self._file

    def get_data(self, path: str | bytes) -> bytes:
        del path
        return self._content


def _of_file(origin: Origin) -> list[Registered]:
    """Execute a file as a module of its own, and return what it registers."""
    name = f"gcs_formation_plugin_{origin.sha256[:16]}"
    spec = spec_from_loader(name, _Content(origin.file, origin.content or b""), origin=origin.file)
    assert spec is not None
    assert spec.loader is not None
    module = module_from_spec(spec)
    sys.modules[name] = module  # where annotations and pickles of its classes are looked up
    _load(partial(spec.loader.exec_module, module), origin.file, OPTION)
    found = list(registered_of(module, origin))
    if not found:
        raise refused("", "registers nothing", "a register function of gcs_formation.extend", f"{OPTION} {origin.file}")
    return found


def _entry_points() -> tuple[EntryPoint, ...]:
    """Return the entry points of our group; they are read again once a folder of packages has changed."""
    return _read_entry_points(tuple((place, _changed_ns(place)) for place in sys.path))


@lru_cache(1)
def _read_entry_points(places: tuple[tuple[str, int], ...]) -> tuple[EntryPoint, ...]:
    del places
    return tuple(entry_points(group=GROUP))


def _changed_ns(place: str) -> int:
    try:
        return Path(place).stat().st_mtime_ns
    except OSError:
        return 0


def _installed(entry: EntryPoint) -> list[Registered]:
    """Import an installed package's module, and return what it and the other modules of its package register."""
    package = entry.module.partition(".")[0]
    dist = entry.dist
    who = f"package {dist.name if dist else package}"
    _load(entry.load, entry.value, who)
    found = list[Registered]()
    for name, module in sorted(sys.modules.items()):
        if (name == package or name.startswith(f"{package}.")) and MARKS in vars(module):
            file = str(module.__file__)
            digest = hashlib.sha256(Path(file).read_bytes()).hexdigest()
            named = (dist.name, dist.version) if dist else (package, None)
            found += registered_of(module, Origin(file, digest, None, entry.value, *named))
    return found


def _load(load: Callable[[], object], file: str, what: str) -> None:
    """Execute a module from outside, which may raise anything.

    Raises:
        ScenarioError: it did; with the line.
    """
    try:
        load()
    except Exception as error:  # a module from outside
        line = line_in(error, file)
        found = f"{type(error).__name__}: {error}"
        raise refused("", found, "", f"{what} {file}{f':{line}' if line else ''}") from error
