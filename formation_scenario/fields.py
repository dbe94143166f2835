"""Types of scenario values with descriptions of what is allowed, and the problems reported in these terms."""

from __future__ import annotations

import difflib
import json
from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass
from functools import cached_property
from typing import TYPE_CHECKING, Annotated, Any, Final, Literal, Self, TypeAlias, TypeVar, cast

from pydantic import (
    BaseModel,
    BeforeValidator,
    ConfigDict,
    Discriminator,
    Field,
    GetJsonSchemaHandler,
    StrictBool,
    StrictStr,
    TypeAdapter,
    WithJsonSchema,
)
from pydantic.config import JsonDict
from pydantic_core import CoreSchema, PydanticCustomError
from pydantic_core.core_schema import (
    definitions_schema,
    dict_schema,
    float_schema,
    literal_schema,
    no_info_after_validator_function,
    no_info_plain_validator_function,
    nullable_schema,
    str_schema,
)

Entry = TypeVar("Entry")

MAX_SYSTEM_ID = 254
MAX_NETWORK = 1000
MAX_NAME_LENGTH = 80
MAX_NUMBER = 1e9
MAX_NEAR_M = 10_000.0
"""Largest distance between two aircraft of a formation, m."""
MAX_DISTANCE_M = 1e6
"""Largest distance of a waypoint from the origin, m."""


class Keys(BaseModel):
    """Base of every group of keys: frozen, and unknown keys are refused."""

    model_config = ConfigDict(extra="forbid", frozen=True, defer_build=True)

    def model_copy(self, *, update: Mapping[str, Any] | None = None, deep: bool = False) -> Self:
        """Return a copy with some keys changed; values cached from the keys are dropped."""
        copied = super().model_copy(update=update, deep=deep)
        for name in vars(copied).keys() - type(self).model_fields.keys():
            del vars(copied)[name]
        return copied

    def __getstate__(self) -> dict[Any, Any]:
        """Return the keys for pickling, without values cached from them."""
        state = super().__getstate__()
        names = type(self).model_fields
        return state | {"__dict__": {name: value for name, value in state["__dict__"].items() if name in names}}


@dataclass(frozen=True, slots=True)
class Allowed:
    """Describes allowed values for which the type's own description is inadequate; `choices` are the allowed words."""

    text: str
    choices: tuple[str, ...] = ()


class OneOf(Allowed):
    """Allows only its choices, which a Literal would have to list one by one."""

    def __get_pydantic_core_schema__(self, source: object, handler: object) -> CoreSchema:
        return literal_schema(list(self.choices))


class Open(Allowed):
    """A word: one of its choices, or one that an extension registers, which is checked where these are known."""

    def __get_pydantic_core_schema__(self, source: object, handler: object) -> CoreSchema:
        return str_schema(strict=True)

    def __get_pydantic_json_schema__(self, schema: CoreSchema, handler: object) -> dict[str, Any]:
        return {"enum": list(self.choices), "type": "string"}


class _HashedKeys(dict[str, Any]):
    """Own keys of an extension or an autopilot that have been checked; a group of keys with them can be in a set.

    Nothing changes it once it is read, so that its hash holds, which a dict's type says it hasn't.
    """

    def __hash__(self) -> int:  # type: ignore[override]
        return hash(json.dumps(self, sort_keys=True))


class _Written(Allowed):
    """A type whose schema is written out, because pydantic takes long to find it, at every start."""

    both: tuple[CoreSchema, dict[str, Any]]

    def __init__(self, text: str, schema: CoreSchema, shown: dict[str, Any]) -> None:
        super().__init__(text)
        both = nullable_schema(schema), {"anyOf": [shown, {"type": "null"}]}
        object.__setattr__(self, "both", both)  # it is frozen

    def __get_pydantic_core_schema__(self, source: object, handler: object) -> CoreSchema:
        return self.both[0]

    def __get_pydantic_json_schema__(self, schema: CoreSchema, handler: object) -> dict[str, Any]:
        return self.both[1]


if TYPE_CHECKING:
    Later = Annotated[Entry, "as it is"]
else:

    class Later:
        """`Later[T]` is T, checked by a schema that is built when there first is a value: most groups are left out."""

        def __class_getitem__(cls, of: object) -> object:
            """Return the type."""
            return Annotated[of, cls(of)]

        def __init__(self, of: object) -> None:
            """Take the type of values."""
            self._of = of

        @cached_property
        def _adapter(self) -> TypeAdapter[Any]:
            return TypeAdapter(self._of)

        def _checked(self, value: object) -> object:
            one = isinstance(self._of, type) and issubclass(self._of, BaseModel)
            return self._of.model_validate(value) if one else self._adapter.validate_python(value)

        def __get_pydantic_core_schema__(self, source: object, handler: object) -> CoreSchema:
            return no_info_plain_validator_function(self._checked)

        def __get_pydantic_json_schema__(self, schema: CoreSchema, handler: GetJsonSchemaHandler) -> dict[str, Any]:
            return handler(definitions_schema(self._adapter.core_schema, []))  # so that groups of keys stay named


OwnKeys: TypeAlias = Annotated[
    Mapping[str, Any] | None,
    _Written(
        "a mapping of the own keys of what an extension registers",
        no_info_after_validator_function(_HashedKeys, dict_schema(str_schema(strict=True))),
        {"type": "object"},
    ),
]
"""Own keys, or None."""
AutopilotParameters: TypeAlias = Annotated[
    Mapping[str, float] | None,
    _Written(
        "a mapping of numbers by the parameters' names, in capitals and at most 16 letters long",
        no_info_after_validator_function(
            _HashedKeys,
            dict_schema(
                str_schema(strict=True, pattern="^[A-Z][A-Z0-9_]{0,15}$"),
                float_schema(strict=True, allow_inf_nan=False, ge=-MAX_NUMBER, le=MAX_NUMBER),
            ),
        ),
        {"type": "object", "additionalProperties": {"type": "number"}},
    ),
]
"""Values of an autopilot's parameters, or None."""
Word: TypeAlias = Annotated[str | None, _Written("text", str_schema(strict=True), {"type": "string"})]
"""A word, or None."""
OF_AN_EXTENSION = "the own keys of what an extension registers by that name"


DERIVED = "x-default"
"""The JSON schema's keyword for the source of a derived default."""


def key(default: object, description: str = "", *examples: object, derived: str = "") -> Any:  # noqa: ANN401 - as Field
    """Return the field of a key.

    Args:
        default: its default; ... for none.
        description: its meaning, with the unit at the end.
        *examples: example values.
        derived: for a key that `resolve` derives if it isn't given: from what, in words.
    """
    extra: JsonDict | None = {DERIVED: derived} if derived else None
    return Field(
        default=default, description=description or None, examples=list(examples) or None, json_schema_extra=extra
    )


EXTENSION = "of an extension"
"""The tag of a group of keys for every word that is none of ours: one that an extension registers."""


def one_of(key: str, default: str, ours: Sequence[str]) -> Discriminator:
    """Return a discriminator that selects a group of keys, each with a `Tag`, by the word at `key`.

    A word that isn't one of `ours` selects `EXTENSION`; whether there is such an extension is checked elsewhere.
    """

    def word(value: object) -> str:
        given = cast("Mapping[str, Any]", value).get(key, default) if isinstance(value, Mapping) else None
        named = getattr(value, key, default) if given is None else given
        return str(named) if named in ours or not isinstance(named, str) else EXTENSION

    return Discriminator(word, custom_error_type=f"{CHOICE}{key}", custom_error_message="no such group of keys")


CHOICE = "choice of "
"""Prefix of the error type for a word that selects no group of keys; the word's key follows it."""


def _as_number(value: object) -> object:
    """Return an id as a number: as a key of JSON it is text."""
    return int(value) if isinstance(value, str) and value.isascii() and value.isdecimal() and len(value) < 4 else value


def whole(value: object) -> object:
    """Return a whole number as an int: JSON schema, and so editors, accept 3.0 as an integer."""
    return int(value) if isinstance(value, float) and value.is_integer() else value


def _printable(value: object) -> object:
    if not (isinstance(value, str) and 1 <= len(value) <= MAX_NAME_LENGTH and value.isprintable()):
        raise PydanticCustomError("name", "not a name")
    return value


Frame = Literal["leader_heading", "follower_heading", "north"]
"""The frames of slots (`slot_frame`)."""
Number = Annotated[float, Field(strict=True, allow_inf_nan=False, ge=-MAX_NUMBER, le=MAX_NUMBER)]
NonNegative = Annotated[float, Field(strict=True, allow_inf_nan=False, ge=0.0, le=MAX_NUMBER)]
Positive = Annotated[float, Field(strict=True, allow_inf_nan=False, gt=0.0, le=MAX_NUMBER)]
Seconds = Annotated[Positive, Field(le=1e6)]
TimeConstant = Annotated[Number, Field(ge=1e-3, le=1e4)]
Distance = Annotated[NonNegative, Field(le=MAX_NEAR_M)]
Speed = Annotated[Number, Field(ge=1e-3, le=1e3)]
Fraction = Annotated[float, Field(strict=True, allow_inf_nan=False, ge=0.0, le=1.0)]
Rate = Annotated[Number, Field(ge=0.5, le=1000.0)]
WHOLE = BeforeValidator(whole)
"""Accompanies a strict int."""
Flag = StrictBool
Text = StrictStr
Name = Annotated[
    str,
    BeforeValidator(_printable),
    WithJsonSchema({"type": "string", "minLength": 1, "maxLength": MAX_NAME_LENGTH}),
    Allowed(f"text of 1 to {MAX_NAME_LENGTH} printable characters"),
]
SystemId = Annotated[
    int,
    Field(strict=True, ge=1, le=MAX_SYSTEM_ID),
    WHOLE,
    Allowed(f"a whole number from 1 to {MAX_SYSTEM_ID} (for more vehicles give some another `network`)"),
]
NetworkId = Annotated[int, Field(strict=True, ge=1, le=MAX_NETWORK), WHOLE]
MAX_ENTRIES: Final = 1000
"""Longest list of things that happen in a flight."""
AtMost: TypeAlias = Annotated[tuple[Entry, ...], Field(max_length=MAX_ENTRIES)]
"""A list of groups of keys whose length is limited, so that a file is checked within seconds."""
Vector: TypeAlias = Annotated[
    tuple[Number, Number, Number], Allowed(f"a list of 3 finite numbers, up to ±{MAX_NUMBER:g}")
]
Near = Annotated[Number, Field(ge=-MAX_NEAR_M, le=MAX_NEAR_M)]
Offset: TypeAlias = Annotated[tuple[Near, Near, Near], Allowed(f"a list of 3 numbers, up to ±{MAX_NEAR_M:g}")]
VehicleRef: TypeAlias = Annotated[
    Annotated[int, Field(strict=True, ge=1, le=MAX_SYSTEM_ID), WHOLE, BeforeValidator(_as_number)]
    | Annotated[str, Field(strict=True, pattern=r"^[1-9][0-9]{0,3}:[1-9][0-9]{0,2}$")],
    Allowed("a vehicle's id, or 'network:id'"),
]
VehicleSelection: TypeAlias = Annotated[
    Literal["all"] | Annotated[tuple[VehicleRef, ...], Field(min_length=1)],
    Allowed("all, or a list of vehicle ids such as [2, 3]"),
]


class Timed(Keys):
    """Something that happens to some vehicles at a mission time."""

    at_s: NonNegative = key(..., "when it happens, s", 40)
    vehicles: VehicleSelection = key("all", "to whom: all, or a list of ids", [2, 3])


@dataclass(frozen=True, slots=True)
class Problem:
    """One problem of a scenario.

    `file` is the scenario's file or the override that it came from, None for a mapping; `line` and `column` count from
    1. `found` is a phrase ("found 'diamnd'"), `allowed` says what is allowed instead, and `would_do` what `check` found
    to do away with it.
    """

    file: str | None
    line: int | None
    column: int | None
    key: str
    found: str
    allowed: str = ""
    would_do: str = ""

    def __str__(self) -> str:
        """Return `file:line:column: key: found; allowed: ...; would do: ...`, without the parts that aren't known."""
        position = ":".join(str(part) for part in (self.file, self.line, self.column) if part is not None)
        what = f"{self.found}; allowed: {self.allowed}" if self.allowed else self.found
        what += f"; would do: {self.would_do}" if self.would_do else ""
        return ": ".join(part for part in (position, self.key, what) if part)


class ScenarioError(Exception):
    """A scenario that can't be flown as written; `problems` are all that was found, in the order of lines."""

    def __init__(self, problems: Sequence[Problem]) -> None:
        files = list(dict.fromkeys(problem.file for problem in problems))
        self.problems = tuple(
            sorted(problems, key=lambda each: (files.index(each.file), each.line or 0, each.column or 0))
        )
        super().__init__("\n".join(str(problem) for problem in self.problems))

    def __reduce__(self) -> tuple[type[ScenarioError], tuple[Sequence[Problem]]]:
        """Return what another process needs to raise it: its problems, without the scenario that has them."""
        return ScenarioError, (self.problems,)


def refused(key: str, found: str, allowed: str = "", file: str | None = None) -> ScenarioError:
    """Return the error of a single problem without a line."""
    return ScenarioError([Problem(file, None, None, key, found, allowed)])


class FileError(Exception):
    """A file that a key names can't be used; the message says what was found, and where."""


def distinct_texts(found: float, allowed: float, digits: int = 3) -> tuple[str, str]:
    """Return both numbers as text, with `digits` digits or as many as it takes to tell them apart."""
    texts = (f"{found:.{digits}g}", f"{allowed:.{digits}g}")
    for more in range(digits + 1, 17):
        if texts[0] != texts[1]:
            break
        texts = (f"{found:.{more}g}", f"{allowed:.{more}g}")
    return texts


def did_you_mean(word: str, choices: Iterable[str]) -> str:
    """Return " (did you mean 'x'?)" for the choice nearest to a word, "" if none is near.

    A choice that is the word with a unit (`speed_mps` for `speed`), or of the same parts, takes precedence.
    """
    known = [choice for choice in choices if choice != word]  # equal if the word is a text of a number's digits
    parts = sorted(word.split("_"))
    same = [choice for choice in known if choice.startswith(f"{word}_") or sorted(choice.split("_")) == parts]
    near = same or difflib.get_close_matches(word, known, n=1)
    return f" (did you mean '{near[0]}'?)" if near else ""
