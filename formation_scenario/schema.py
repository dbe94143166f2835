"""The JSON schema of scenario files and the reference of their keys, both generated from the models of the keys."""

from __future__ import annotations

import inspect
import re
import types
from collections.abc import Iterable, Iterator, Mapping, Sequence
from importlib.resources import files
from typing import Any, Literal, NamedTuple, Union, cast, get_args, get_origin

import yaml
from pydantic import BaseModel, Field, create_model
from pydantic.fields import FieldInfo
from pydantic.json_schema import GenerateJsonSchema
from pydantic_core import PydanticUndefined

from formation_scenario.derived_defaults import MAY_BE_EMPTY
from formation_scenario.error_messages import allowed, bare, is_group, members
from formation_scenario.expectation import METRICS, range_text
from formation_scenario.extensions import (
    AIRCRAFT,
    AUTOPILOT,
    DELAY_ESTIMATOR,
    DISTURBANCE,
    EMULATED_FAMILY,
    FAULT,
    GUIDANCE,
    LAW_KINDS,
    LINK,
    METRIC,
    NAVIGATION,
    PREDICTOR,
    SWITCHED,
    Registered,
)
from formation_scenario.fields import DERIVED
from formation_scenario.formation import SHAPE_NAMES
from formation_scenario.law import LAW_TYPES, PREDICTORS
from formation_scenario.model import Fleet, Scenario
from formation_scenario.path_plan import GUIDANCES
from formation_scenario.registry import OURS, Registry
from formation_scenario.shapes import SHAPE
from formation_scenario.source import Dumper, Plain, show
from formation_scenario.vehicle_files import MODELS
from formation_scenario.vehicles import AUTOPILOTS, CLOCKS, VehicleGroup

Schema = dict[str, Any]
ANNOTATIONS = ("title", "description", "default", "examples", DERIVED)
"""Keywords without effect on validation."""
NULL = {"type": "null"}
LINK_GROUPS = ("Impairment", "ImpairmentPatch", "DefaultLink", "LinkChange", "ScriptedLink")
NAMED: tuple[tuple[str, str, tuple[str, ...], tuple[str, ...]], ...] = (
    ("Law", "type", LAW_KINDS, LAW_TYPES),
    ("OwnPredictor", "type", (PREDICTOR,), PREDICTORS),
    ("OwnGuidance", "type", (GUIDANCE,), GUIDANCES),
    ("Telemetry", "clock", (DELAY_ESTIMATOR,), CLOCKS),
    *((name, "autopilot", (AUTOPILOT,), AUTOPILOTS) for name in ("Vehicle", "VehicleGroup")),
    *((name, "shape", (SHAPE,), SHAPE_NAMES) for name in ("Formation", "FormationChange")),
    *((name, "process", (LINK,), OURS[LINK]) for name in LINK_GROUPS),
    *((name, "kind", (FAULT,), OURS[FAULT]) for name in ("Fault", "ScriptedFault")),
    ("OwnDisturbance", "kind", (DISTURBANCE,), ()),
    ("OwnNavigation", "source", (NAVIGATION,), ()),
    ("OwnEmulator", "family", (EMULATED_FAMILY,), ()),
    ("VehicleModel", "aircraft", (AIRCRAFT,), ()),
)
"""Groups of keys, the word in each that an extension may register, of which kinds, and ours."""
NAMED_KINDS = {name: kinds for name, _, kinds, _ in NAMED}
ONLY_OF_EXTENSIONS = ("OwnDisturbance", "OwnNavigation", "OwnEmulator")
METRICS_HEAD = """
## Metrics

Figures that `expect` may bound, of one follower, of one link, or of the run. They are taken over the window from
`from_s` to `to_s`; those of the whole flight accept no window. A bound outside a figure's range is refused.

| metric | what it is | can be |
| --- | --- | --- |"""
TABLE_HEAD = "| key | what it is | unit | default | allowed | example |\n| --- | --- | --- | --- | --- | --- |"
UNITS_BY_SUFFIX = {
    "mps": "m/s",
    "mps2": "m/s²",
    "rps": "rad/s",
    "radps": "rad/s",
    "kbps": "kbit/s",
    "ppm": "1e-6",
    "deg": "degrees",
    "ug": "micro-g",
    "hz": "Hz",
    "ms": "ms",
    "m": "m",
    "s": "s",
}
UNITS = (*UNITS_BY_SUFFIX.values(), "1/s", "1/s²", "degrees an hour", "deg/sqrt(h)", "micro-g/sqrt(Hz)")
"""As written in descriptions: "delay, ms" or "delay, ms; none if ..."."""


def written_model() -> type[BaseModel]:
    """Return the scenario as it may be written: `vehicles` may be {count: N}, which `resolve` expands to a list."""
    vehicles = Scenario.model_fields["vehicles"]
    described = Field(description=vehicles.description, examples=vehicles.examples)
    return create_model(
        "Scenario", __base__=Scenario, __doc__=Scenario.__doc__, vehicles=(Fleet | VehicleGroup, described)
    )


def scenario_schema(registry: Registry | None = None) -> Schema:
    """Return the JSON schema (draft 2020-12) of a scenario file, with the names and keys of extensions.

    It allows every value that is valid for its key alone. Rules between keys, and whether the formation can be flown,
    are checked only by `load_scenario`.
    """
    generated = written_model().model_json_schema()
    groups = (group for group in generated["$defs"].values() if "properties" in group)
    for group in (generated, *groups):
        _allow_derived(group)
    _allow_extensions(generated, registry or Registry())
    properties: Schema = generated["properties"]
    properties |= {key: _or(properties[key], NULL) for key in MAY_BE_EMPTY}
    head = {"$schema": GenerateJsonSchema.schema_dialect, "title": "Scenario of a formation flight"}
    return head | generated | {"title": head["title"]}


def _allow_extensions(generated: Schema, registry: Registry) -> None:
    """Allow the names that extensions register, each with its own keys; without any, none."""
    groups: Schema = generated["$defs"]
    groups["Expectation"]["properties"]["metric"]["enum"] += registry.names(METRIC)
    for name, word, kinds, ours in NAMED:
        if name in groups:
            _allow_named(groups[name]["properties"], word, [*ours, *registry.names(*kinds)], registry.of(*kinds))
    unregistered = [name for name in ONLY_OF_EXTENSIONS if not registry.of(*NAMED_KINDS[name])]
    for name in unregistered:
        del groups[name]
    _without(generated, [{"$ref": f"#/$defs/{name}"} for name in unregistered])
    known = {each.name: _or(_keys_of(each), NULL) for each in registry.of(*SWITCHED, METRIC)}
    allowed: Schema = {"properties": known, "additionalProperties": False}
    generated["properties"]["extensions"] = (
        _annotations(generated["properties"]["extensions"]) | {"type": "object"} | allowed
    )


def _allow_named(keys: Schema, word: str, names: list[str], registered: Sequence[Registered]) -> None:
    """Allow the names of a word, and beside it the keys of what some of them register."""
    if word in keys:
        allowed: Schema = {"type": "string", "enum": names}
        keys[word] = _annotations(keys[word]) | (_or(allowed, NULL) if _is_optional(keys[word]) else allowed)
    own: Schema = {"anyOf": [{"type": "object", "maxProperties": 0}, *map(_keys_of, registered)]}
    keys["parameters"] = _annotations(keys["parameters"]) | (
        _or(own, NULL) if _is_optional(keys["parameters"]) else own
    )


def _is_optional(value: Schema) -> bool:
    return NULL in value.get("anyOf", [])


def _without(value: object, refused: list[Schema]) -> None:
    """Take some choices from every union in a schema."""
    each: Iterable[object] = ()
    if isinstance(value, dict):
        for union in ("anyOf", "oneOf"):
            if union in value:
                value[union] = [choice for choice in value[union] if choice not in refused]
        each = value.values()
    elif isinstance(value, list):
        each = value
    for inner in each:
        _without(inner, refused)


def _annotations(value: Schema) -> Schema:
    """Return a schema's description and default; an example would need an extension."""
    return {name: value[name] for name in ("description", "default") if name in value}


def _keys_of(extension: Registered) -> Schema:
    """Return the schema of an extension's own keys, without those that it doesn't have."""
    model = extension.keys_model
    return {"additionalProperties": False} | model.model_json_schema(ref_template="#/$defs/{model}")


def _allow_derived(group: Schema) -> None:
    """Allow derived keys to be absent or empty, and a vehicle's model to be a name."""
    properties: Schema = group["properties"]
    for key, value in properties.items():
        value.pop("title", None)  # it only repeats the key
        written = _or(value, {"type": "string", "minLength": 1}) if key in MODELS else value
        if DERIVED in value:
            annotations = [*([value["description"]] if "description" in value else []), f"default: {value[DERIVED]}"]
            written = _or(written, NULL) | {"description": "; ".join(annotations)}
            written.pop("default", None)
        properties[key] = written
    required = [key for key in group.pop("required", []) if DERIVED not in properties[key]]
    if required:
        group["required"] = required


def _or(value: Schema, other: Schema) -> Schema:
    """Return the schema of a value that may also be another one."""
    annotations = {name: each for name, each in value.items() if name in ANNOTATIONS}
    types = {name: each for name, each in value.items() if name not in ANNOTATIONS}
    choices: list[Schema] = types["anyOf"] if set(types) == {"anyOf"} else [types]
    return {"anyOf": [*choices, *([] if other in choices else [other])], **annotations}


class _Group(NamedTuple):
    """A group of keys: its dotted path (`[]`: each item of a list), and its word in a choice (`ramp`)."""

    path: str
    word: str
    model: type[BaseModel]
    field: FieldInfo

    @property
    def title(self) -> str:
        """The group's heading."""
        return f"`{self.path}`" + (f": {self.word}" if self.word else "")


def scenario_reference() -> str:
    """Return the reference in Markdown.

    Raises:
        ValueError: a key has no description or no example.
    """
    top = written_model()
    sections, shown = dict[type[BaseModel], list[_Group]](), set[str]()
    for group in _groups_in(top, ""):
        sections.setdefault(group.model, []).append(group)
    links = _links([groups[0] for groups in sections.values()])
    head = (files("formation_scenario") / "reference.md").read_text(encoding="utf-8")
    parts = [head, "## Top level\n", _table(top, links)]
    for model, groups in sections.items():
        also = [title for title in dict.fromkeys(group.title for group in groups) if title != groups[0].title]
        parts += [f"\n## {groups[0].title}\n", *([f"Also: {', '.join(also)}.\n"] if also else [])]
        parts += [_docstring(model), "", *(text for text in _examples(groups[0]) if text not in shown)]
        parts.append(_table(model, links))
        shown.update(_examples(groups[0]))
    metrics = [f"| `{name}` | {meaning} | {range_text(name)} |" for name, meaning in METRICS.items()]
    return "\n".join([*parts, METRICS_HEAD, *metrics]) + "\n"


def _groups_in(model: type[BaseModel], path: str, seen: frozenset[type] = frozenset()) -> Iterator[_Group]:
    """Yield the groups of keys inside a model, each before those inside itself."""
    for name, field in model.model_fields.items():
        for inner, word, group in _groups_of(field, f"{path}.{field.alias or name}".lstrip(".")):
            yield _Group(inner, word, group, field)
            if group not in seen:
                yield from _groups_in(group, inner, seen | {group})


def _groups_of(annotation: object, path: str, word: str = "") -> Iterator[tuple[str, str, type[BaseModel]]]:
    """Yield the groups of keys that a type allows, with their paths and words."""
    plain, _ = bare(annotation)
    if is_group(plain):
        yield path, word, plain
    elif get_origin(plain) is tuple and get_args(plain)[1:] == (...,):
        yield from _groups_of(get_args(plain)[0], f"{path}[]")
    elif tagged := members(plain):
        for tag, group in tagged.items():
            yield from _groups_of(group, path, str(tag))
    elif get_origin(plain) in {Union, types.UnionType}:
        for each in get_args(plain):
            yield from _groups_of(each, path)


def _links(headed: Sequence[_Group]) -> dict[type[BaseModel], str]:
    """Return the link to each group's section, with the anchor that GitHub gives its heading."""
    anchors, links = list[str](), dict[type[BaseModel], str]()
    for group in headed:
        anchor = re.sub(r"[^\w -]", "", group.title.lower()).replace(" ", "-")
        again = anchors.count(anchor)
        anchors.append(anchor)
        links[group.model] = f"[{group.word or f'`{group.path}`'}](#{anchor}{f'-{again}' if again else ''})"
    return links


def _docstring(model: type[BaseModel]) -> str:
    return inspect.cleandoc(model.__doc__ or "")


def _examples(group: _Group) -> Iterator[str]:
    """Yield the examples of a list or a mapping of keys, in YAML, each with the keys around it."""
    for each in group.field.examples or []:
        nested: Plain = each
        for key in reversed(group.path.replace("[]", "").split(".")):
            nested = {key: nested}
        text = yaml.dump(nested, Dumper=Dumper, sort_keys=False, default_flow_style=None, width=110)
        yield f"```yaml\n{text}```\n"


def _table(model: type[BaseModel], links: Mapping[type[BaseModel], str]) -> str:
    return "\n".join([TABLE_HEAD, *(_row(f.alias or name, f, links) for name, f in model.model_fields.items())])


def _row(key: str, field: FieldInfo, links: Mapping[type[BaseModel], str]) -> str:
    groups = [group for _, _, group in _groups_of(field, key)]
    annotations = field.description or "".join(_docstring(group).partition("\n")[0].rstrip(".") for group in groups[:1])
    shown = None if groups else example(field)
    if not annotations or shown is PydanticUndefined:
        raise ValueError(f"key {key}: found no description or no example; allowed: key(default, description, example)")
    text, unit = _unit(key, annotations)
    words = allowed(field)
    words = "one of the [metrics](#metrics)" if words == ", ".join(METRICS) else words
    ends = [", ".join(links[group] for group in groups), ""] if groups else [words, f"`{key}: {_shown(shown)}`"]
    cells = (f"`{key}`", text, "" if groups else unit, _default(field), *ends)
    return "| " + " | ".join(cell.replace("|", "\\|") for cell in cells) + " |"


def _unit(key: str, text: str) -> tuple[str, str]:
    """Return a description without the unit at its end, and that unit, or else the unit of the key's suffix."""
    for unit in sorted(UNITS, key=len, reverse=True):
        before, found, after = text.partition(f", {unit}")
        if found and (not after or after.startswith(";")):
            return before + after, unit
    return text, UNITS_BY_SUFFIX.get(key.rpartition("_")[2], "") if "_" in key else ""


def _default(field: FieldInfo) -> str:
    extra = cast("Mapping[str, object]", field.json_schema_extra if isinstance(field.json_schema_extra, dict) else {})
    if DERIVED in extra:
        return str(extra[DERIVED])
    if field.is_required():
        return "required"
    if isinstance(field.default, BaseModel):
        return "its keys'"
    return "none" if field.default is None else f"`{_shown(field.default)}`"


def example(field: FieldInfo) -> Any:  # noqa: ANN401 - any value of any key
    """Return an example of a key's value: its own, or else a choice that isn't its default, or else its default."""
    if field.examples:
        return field.examples[0]
    plain, _ = bare(field)
    choices: tuple[object, ...] = (
        (True, False) if plain is bool else get_args(plain) if get_origin(plain) is Literal else ()
    )
    return next((choice for choice in choices if choice != field.default), field.default)


def _shown(value: Any) -> str:  # noqa: ANN401 - any value of any key
    """Return a value as a person would write it in YAML."""
    return show(value, width=100).strip("'") if isinstance(value, str) else show(_plain(value), width=100)


def _plain(value: Any) -> Plain:  # noqa: ANN401 - any value of any key
    """Return a value with lists for tuples, and whole numbers without a point."""
    if isinstance(value, tuple | list):
        return [_plain(each) for each in cast("Sequence[object]", value)]
    return int(value) if isinstance(value, float) and value.is_integer() else value
