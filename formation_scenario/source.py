"""Reads scenario text into plain values, and keeps the position in the file that each key came from."""

from __future__ import annotations

import re
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field, replace
from pathlib import Path
from typing import Any, NamedTuple, TypeAlias, cast

import numpy as np
import yaml

from formation_scenario.bounded_read import read_bounded
from formation_scenario.fields import Problem, ScenarioError, refused

try:
    from yaml import CSafeLoader as FastLoader
except ImportError:  # PyYAML without libyaml
    # Types differ by the parser alone, which isn't used.
    from yaml import SafeLoader as FastLoader  # type: ignore[assignment]

Key: TypeAlias = str | int
KeyPath: TypeAlias = tuple[Key, ...]
Plain: TypeAlias = "bool | int | float | str | list[Plain] | dict[Key, Plain] | None"

_MERGE_TAG = "tag:yaml.org,2002:merge"
_INT_TAG = "tag:yaml.org,2002:int"
_FLOAT_TAG = "tag:yaml.org,2002:float"
# YAML 1.1, which PyYAML follows, reads 1e3 as text, 1:30 as 90 and 010 as 8.
_INT = re.compile(r"^[-+]?(?:0|[1-9][0-9_]*|0x[0-9a-fA-F_]+)$")
_FLOAT = re.compile(
    r"^[-+]?(?:(?:[0-9][0-9_]*\.[0-9_]*|\.[0-9][0-9_]*)(?:[eE][-+]?[0-9]+)?|[0-9]+[eE][-+]?[0-9]+"
    r"|\.(?:inf|Inf|INF))$|^\.(?:nan|NaN|NAN)$"
)
MAX_DIGITS = 100
"""Limit of a whole number's length. Python refuses to parse or print 5000 digits, and 400 exceed a float."""

MAX_VALUES = 500_000
"""Limit of all values: a few nested aliases could expand to more than any memory holds."""
ALLOWED_VALUES = f"text, true, false, null, or a number; a whole one of up to {MAX_DIGITS} digits"


Finding: TypeAlias = tuple[KeyPath, str, str]
"""A problem in a scenario: the key, what was found, and what is allowed instead."""


class FilePosition(NamedTuple):
    """Where a value came from; `line` and `column` count from 1."""

    file: str | None
    line: int | None = None
    column: int | None = None


@dataclass(frozen=True, slots=True)
class Source:
    """A scenario as plain values, and the position of each key path in its file."""

    file: str | None
    data: dict[Key, Plain]
    positions: Mapping[KeyPath, FilePosition] = field(default_factory=dict[KeyPath, FilePosition])

    def position(self, path: KeyPath) -> FilePosition:
        """Return the position of a key, or else of the nearest enclosing key that has one."""
        enclosing = (self.positions.get(path[:length]) for length in range(len(path), 0, -1))
        return next(filter(None, enclosing), FilePosition(self.file))

    @property
    def home(self) -> Path | None:
        """The directory of its file; None if it isn't one."""
        return None if self.file is None else Path(self.file).parent

    @property
    def directory(self) -> Path:
        """The directory to which the files that it names are relative: its file's, or the working directory."""
        return Path(self.file).parent if self.file else Path()

    def problem(self, path: KeyPath, found: str, allowed: str = "", would_do: str = "") -> Problem:
        """Return a problem at a key's position."""
        return Problem(*self.position(path), dotted(path), found, allowed, would_do)


def _numbers_of_yaml_1_2(
    resolvers: Mapping[str | None, Sequence[tuple[str, re.Pattern[str]]]],
) -> dict[str | None, list[tuple[str, re.Pattern[str]]]]:
    replaced = {_INT_TAG, _FLOAT_TAG, "tag:yaml.org,2002:timestamp"}
    kept = {first: [pair for pair in pairs if pair[0] not in replaced] for first, pairs in resolvers.items()}
    for first in "-+.0123456789":
        kept.setdefault(first, []).extend([(_INT_TAG, _INT), (_FLOAT_TAG, _FLOAT)])
    return kept


class Loader(yaml.SafeLoader):
    """PyYAML's safe loader with the numbers of YAML 1.2 and without dates."""

    yaml_implicit_resolvers = _numbers_of_yaml_1_2(yaml.SafeLoader.yaml_implicit_resolvers)


class LibyamlLoader(FastLoader):
    """The same by libyaml, several times as fast; its messages of broken YAML say less."""

    yaml_implicit_resolvers = Loader.yaml_implicit_resolvers


LONG_TEXT = 100_000
"""From this length on, characters, what is wrong is said in libyaml's words: PyYAML would take too long."""


class Dumper(yaml.SafeDumper):
    """The dumper whose output `Loader` reads back: it quotes texts that `Loader` would take for numbers."""

    yaml_implicit_resolvers = Loader.yaml_implicit_resolvers

    def ignore_aliases(self, data: object) -> bool:  # noqa: ARG002 - the signature is PyYAML's
        """Write every value out, never as an alias."""
        return True


AnyLoader: TypeAlias = Loader | LibyamlLoader


def dotted(path: KeyPath) -> str:
    """Return a key path as in overrides: `vehicles.1.model.tau_v_s`, list items from 0."""
    return ".".join(str(key) for key in path)


MAX_BYTES = 2_000_000
"""Longest file of keys: more takes YAML's reader too long."""


def read_file(path: Path, of: str = "scenario") -> Source:
    """Read a scenario file, or another file of keys, whose kind is `of` in messages.

    Raises:
        ScenarioError: the file can't be read, or isn't YAML with a mapping at its top.
    """
    try:
        text = read_bounded(path, MAX_BYTES).decode("utf-8")
    except IsADirectoryError as error:
        raise refused("", "found a directory", f"a {of} file (*.yaml)", str(path)) from error
    except OSError as error:
        raise refused("", error.strerror or str(error), file=str(path)) from error
    except UnicodeDecodeError as error:
        found = f"found byte 0x{error.object[error.start]:02x} at offset {error.start}"
        raise refused("", found, "text in UTF-8", str(path)) from error
    return read_text(text, str(path), of)


def read_text(text: str, file: str | None = None, of: str = "scenario") -> Source:
    """Read keys of a scenario, or of the kind `of`, from YAML text; `file` names it in messages.

    Raises:
        ScenarioError: broken YAML, a key given twice, or no mapping at the top.
    """
    data, positions = _read(text, file)
    if not isinstance(data, dict):
        raise ScenarioError([Problem(file, 1, 1, "", f"found {kind(data)}", f"a mapping of {of} keys")])
    return Source(file, data, positions)


def plain_mapping(mapping: Mapping[Any, object], above: KeyPath = ()) -> dict[Key, Plain]:
    """Return a mapping at a key path in plain values; numpy's numbers and arrays become numbers and lists.

    Raises:
        ScenarioError: a value that is neither number, text, list nor mapping.
    """
    keys: dict[Key, object] = {name if isinstance(name, int) else str(name): item for name, item in mapping.items()}
    return {key: _plain(item, (*above, key)) for key, item in keys.items()}


def read_value(text: str, path: KeyPath) -> Plain:
    """Read one key's value as YAML.

    Raises:
        ScenarioError: broken YAML, or a key given twice; problems have no lines.
    """
    try:
        return _read(text, None, path)[0]
    except ScenarioError as error:
        keyed = [replace(each, line=None, column=None, key=each.key or dotted(path)) for each in error.problems]
        raise ScenarioError(keyed) from error


def kind(value: Plain) -> str:
    """Return the kind of a value in YAML's terms, or the value itself if it is a scalar."""
    if isinstance(value, dict):
        return "a mapping"
    if isinstance(value, list):
        return "a list"
    return "nothing" if value is None else show(value)


def show(value: Plain, width: int = 60) -> str:
    """Return a value as YAML would write it, on one line, cut to `width` characters; text is quoted."""
    if isinstance(value, str):
        text = repr(value)
    else:
        dumped = yaml.dump(value, Dumper=Dumper, default_flow_style=True, width=10**6, sort_keys=False)
        text = dumped.removesuffix("...\n").strip()
    return text if len(text) <= width else f"{text[: width - 3]}..."


def _plain(value: object, path: KeyPath) -> Plain:
    if isinstance(value, np.ndarray | np.generic):
        value = cast("object", value.tolist())
    if isinstance(value, int) and abs(value) >= 10**MAX_DIGITS:
        raise refused(dotted(path), f"found a number of more than {MAX_DIGITS} digits", ALLOWED_VALUES)
    if value is None or isinstance(value, bool | int | float | str):
        return value
    if isinstance(value, Mapping):
        return plain_mapping(cast("Mapping[Any, object]", value), path)
    if isinstance(value, Sequence) and not isinstance(value, bytes | bytearray):
        return [_plain(item, (*path, index)) for index, item in enumerate(cast("Sequence[object]", value))]
    raise refused(dotted(path), f"found a {type(value).__name__}", "number, text, list, mapping")


def _read(text: str, file: str | None, path: KeyPath = ()) -> tuple[Plain, dict[KeyPath, FilePosition]]:
    """Return YAML's values and their positions, by libyaml where it reads the text as PyYAML does.

    PyYAML reads again what libyaml refuses, because it says more; and tabs, about which the two differ.
    """
    long = len(text) > LONG_TEXT
    if long or "\t" not in text:
        try:
            return _Reader(text, file).read(LibyamlLoader, path)
        except ScenarioError:
            if long:
                raise
    return _Reader(text, file).read(Loader, path)


class _Reader:
    """Reads one YAML document."""

    def __init__(self, text: str, file: str | None) -> None:
        self._text = text
        self._file = file
        self._positions: dict[KeyPath, FilePosition] = {}
        self._problems: list[Problem] = []
        self._count = 0
        self._within = list[yaml.Node]()
        """The lists and mappings around the present value."""

    def read(self, by: type[AnyLoader], path: KeyPath) -> tuple[Plain, dict[KeyPath, FilePosition]]:
        try:
            loader = by(self._text)
            node: yaml.Node | None = loader.get_single_node()
            data = None if node is None else self._value(loader, node, path)
        except yaml.YAMLError as error:
            self._problems.append(self._broken(error))
            data = None
        except RecursionError as error:
            raise refused("", "found lists or mappings nested too deeply", file=self._file) from error
        if self._problems:
            raise ScenarioError(self._problems)
        return data, self._positions

    def _value(self, loader: AnyLoader, node: yaml.Node, path: KeyPath) -> Plain:
        self._count += 1
        if self._count > MAX_VALUES:
            raise yaml.MarkedYAMLError(problem=f"found more than {MAX_VALUES} values", problem_mark=node.start_mark)
        if isinstance(node, yaml.ScalarNode):
            return self._scalar(loader, node, path)
        if any(node is each for each in self._within):
            found = f"{dotted(path)} is an alias of what begins here, which it is part of itself"
            raise yaml.MarkedYAMLError(problem=found, problem_mark=node.start_mark)
        self._within.append(node)
        if isinstance(node, yaml.MappingNode):
            value: Plain = self._mapping(loader, node, path)
        else:
            value = self._list(loader, cast("yaml.SequenceNode", node), path)
        self._within.pop()
        return value

    def _scalar(self, loader: AnyLoader, node: yaml.ScalarNode, path: KeyPath) -> Plain:
        value = _constructed(loader, node)
        if value is None or isinstance(value, bool | int | float | str):
            return value
        found = f"found {show(cast('str', node.value))}"
        self._problems.append(Problem(*self._position(node), dotted(path), found, ALLOWED_VALUES))
        return None

    def _list(self, loader: AnyLoader, node: yaml.SequenceNode, path: KeyPath) -> list[Plain]:
        items = cast("list[yaml.Node]", node.value)
        for index, item in enumerate(items):
            self._positions[(*path, index)] = self._position(item)
        return [self._value(loader, item, (*path, index)) for index, item in enumerate(items)]

    def _mapping(self, loader: AnyLoader, node: yaml.MappingNode, path: KeyPath) -> dict[Key, Plain]:
        self._refuse_duplicates(node, path)
        loader.flatten_mapping(node)
        result: dict[Key, Plain] = {}
        for key_node, value_node in cast("list[tuple[yaml.Node, yaml.Node]]", node.value):
            key = _key(key_node)
            self._positions[(*path, key)] = self._position(key_node)
            result[key] = self._value(loader, value_node, (*path, key))
        return result

    def _refuse_duplicates(self, node: yaml.MappingNode, path: KeyPath) -> None:
        first: dict[Key, FilePosition] = {}
        for key_node, _ in cast("list[tuple[yaml.Node, yaml.Node]]", node.value):
            key, position = _key(key_node), self._position(key_node)
            if key in first and key_node.tag != _MERGE_TAG:
                found = "found a second time"
                if "\n" in self._text or self._file is not None:
                    found += f", first on line {first[key].line}"
                self._problems.append(Problem(*position, dotted((*path, key)), found, "each key once"))
            first.setdefault(key, position)

    def _position(self, node: yaml.Node) -> FilePosition:
        return FilePosition(self._file, node.start_mark.line + 1, node.start_mark.column + 1)

    def _broken(self, error: yaml.YAMLError) -> Problem:
        if isinstance(error, yaml.MarkedYAMLError) and error.problem_mark is not None:
            mark, allowed = error.problem_mark, "spaces to indent by" if "'\\t'" in str(error.problem) else ""
            found = f"broken YAML: {error.problem}"
            if isinstance(error, yaml.composer.ComposerError) and "another document" in str(error.problem):
                found, allowed = "found another document", "one in a file"
            return Problem(self._file, mark.line + 1, mark.column + 1, "", found, allowed)
        if isinstance(error, yaml.reader.ReaderError):
            line = self._text.count("\n", 0, error.position) + 1
            return Problem(self._file, line, None, "", f"broken YAML: {error.reason}")
        return Problem(self._file, None, None, "", f"broken YAML: {error}")


def _key(node: yaml.Node) -> Key:
    if not isinstance(node, yaml.ScalarNode):
        raise yaml.MarkedYAMLError(problem="found a list or mapping as a key", problem_mark=node.start_mark)
    text = cast("str", node.value)
    whole = node.tag == _INT_TAG and _INT.match(text) and len(text) <= MAX_DIGITS
    return int(text.replace("_", ""), 0) if whole else text


def _constructed(loader: AnyLoader, node: yaml.ScalarNode) -> object:
    """Return a scalar's value; the node itself if it has none, because its tag doesn't fit the text."""
    if node.tag == _INT_TAG and len(cast("str", node.value)) > MAX_DIGITS:
        return node
    try:
        return cast("object", loader.construct_object(node))
    except (AttributeError, KeyError, ValueError):
        return node
