"""The JSON schema of scenario files, generated from the models of their keys."""

from __future__ import annotations

from collections.abc import Iterator
from typing import Any

from pydantic import BaseModel, Field, create_model
from pydantic.json_schema import GenerateJsonSchema

from formation_scenario.fields import DERIVED
from formation_scenario.model import Fleet, Scenario
from formation_scenario.resolve import MAY_BE_EMPTY
from formation_scenario.vehicles import VehicleGroup

Schema = dict[str, Any]
ANNOTATIONS = ("title", "description", "default", "examples", DERIVED)
"""Keywords that allow or refuse nothing."""


def written_model() -> type[BaseModel]:
    """Return the scenario as it may be written: `vehicles` may be {count: N}, which `resolve` turns into a list."""
    vehicles = Scenario.model_fields["vehicles"]
    described = Field(description=vehicles.description, examples=vehicles.examples)
    return create_model(
        "Scenario", __base__=Scenario, __doc__=Scenario.__doc__, vehicles=(Fleet | VehicleGroup, described)
    )


def scenario_schema() -> Schema:
    """Return the JSON schema (draft 2020-12) of a scenario file.

    It allows every value that a key by itself may have. What keys must be to each other, and whether the formation can
    be flown, only `load_scenario` knows.
    """
    generated = written_model().model_json_schema(schema_generator=_WithoutTitlesOfKeys)
    for group in _groups(generated):
        _name_models(group)
        _release_derived(group)
    properties: Schema = generated["properties"]
    properties |= {key: _or_null(properties[key]) for key in MAY_BE_EMPTY}
    head = {"$schema": GenerateJsonSchema.schema_dialect, "title": "Scenario of a formation flight"}
    return head | generated | {"title": head["title"]}


class _WithoutTitlesOfKeys(GenerateJsonSchema):
    """pydantic's generator, without titles that only repeat a key."""

    def field_title_should_be_set(self, schema: Any) -> bool:  # noqa: ANN401, ARG002 - pydantic's signature
        """Return False."""
        return False


def _groups(schema: Schema) -> Iterator[Schema]:
    """Yield the groups of keys: the scenario's, and all inside it."""
    yield schema
    yield from (group for group in schema["$defs"].values() if "properties" in group)


def _name_models(group: Schema) -> None:
    """Let a vehicle's model be named: `resolve` reads its file."""
    properties: Schema = group["properties"]
    for key in ("model", "true_model"):
        if key in properties:
            properties[key] = _or(properties[key], {"type": "string", "minLength": 1})


def _release_derived(group: Schema) -> None:
    """Let keys that `resolve` fills in be left out, or empty."""
    properties: Schema = group["properties"]
    derived = [key for key, value in properties.items() if DERIVED in value]
    for key in derived:
        value = {name: each for name, each in _or_null(properties[key]).items() if name != "default"}
        said = [*([value["description"]] if "description" in value else []), f"default: {value[DERIVED]}"]
        properties[key] = value | {"description": "; ".join(said)}
    required = [key for key in group.get("required", []) if key not in derived]
    group.pop("required", None)
    if required:
        group["required"] = required


def _or_null(value: Schema) -> Schema:
    """Return the schema of a value that may be null too."""
    return _or(value, {"type": "null"})


def _or(value: Schema, other: Schema) -> Schema:
    """Return the schema of a value that may be another one too."""
    said = {name: each for name, each in value.items() if name in ANNOTATIONS}
    types = {name: each for name, each in value.items() if name not in ANNOTATIONS}
    choices: list[Schema] = types["anyOf"] if set(types) == {"anyOf"} else [types]
    return {"anyOf": [*choices, *([] if other in choices else [other])], **said}
