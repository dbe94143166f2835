"""Keys that features bring to the groups of a scenario.

A feature's module `keys` has a class of `BroughtKeys` for each place in a group where it adds keys, and names them in
`KEYS`; in `WORDS` it has the words that it adds to those which a key of the core allows. A group that is open,
`class Safety(OpenGroup, group="safety")`, takes them when its class is made: in types, error texts, schema and
reference they are keys like its own. So every program that reads scenarios knows all keys of the features that are
there, and a key of a feature whose folder is missing is an unknown key.

The feature reads them by its class, `SeparationKeys.of(scenario).avoidance`; the core, which knows no feature, asks a
group for values of a kind that it knows: `scenario.safety.each(KeepsDistance)`.

A module `keys` imports nothing that imports `formation_scenario.model`, for it is loaded while that is: rules over
whole scenarios are in the feature's module `rules`.
"""

from __future__ import annotations

from collections.abc import Iterator, Mapping, Sequence
from functools import cache
from typing import TYPE_CHECKING, Any, ClassVar, Self, TypeVar, cast, get_type_hints

from formation_scenario.feature_folders import brought
from formation_scenario.fields import Keys

if TYPE_CHECKING:  # it loads numpy, which an order to a flight doesn't need
    from formation_scenario.source import Key, Plain

Kind = TypeVar("Kind")


class BroughtKeys:
    """Keys that a feature adds to one place of a group; typed, it is that group as the feature sees it."""

    group: ClassVar[str]
    """The group's key at the top of a scenario."""
    after: ClassVar[tuple[str, ...]]
    """Keys of the group behind which these stand; those that aren't there are passed over."""

    def __init_subclass__(cls, *, group: str, after: tuple[str, ...]) -> None:
        """Take the place of the keys."""
        super().__init_subclass__()
        cls.group, cls.after = group, after

    @classmethod
    def of(cls, scenario: Keys) -> Self:
        """Return the group of a scenario, which has these keys."""
        return cast("Self", getattr(scenario, cls.group))

    @classmethod
    def with_defaults(cls, group: dict[Key, Plain]) -> dict[Key, Plain]:
        """Return the group as written with the derived defaults of these keys."""
        return group

    @classmethod
    def fields(cls) -> dict[str, tuple[Any, Any]]:
        """Return the type and the default, or the field, of each key."""
        hints = get_type_hints(cls, include_extras=True)
        return {name: (hints[name], vars(cls)[name]) for name in vars(cls).get("__annotations__", ())}


class OpenGroup(Keys):
    """Base of a group of keys to which features may add."""

    def __init_subclass__(cls, *, group: str | None = None, **given: Any) -> None:
        """Add what features bring to `group`, before pydantic collects the fields of the class."""
        super().__init_subclass__(**given)
        if group is not None:
            _add(cls, [each for each in brought_keys() if each.group == group])

    def each(self, kind: type[Kind]) -> Iterator[Kind]:
        """Yield the values of a kind among its keys."""
        values = (getattr(self, name) for name in type(self).model_fields)
        return (value for value in values if isinstance(value, kind))


@cache
def brought_keys() -> tuple[type[BroughtKeys], ...]:
    """Return the keys that the features which are there bring, in the features' order."""
    return tuple(each for module in brought("keys") for each in getattr(module, "KEYS", ()))


def brought_words(name: str) -> tuple[str, ...]:
    """Return the words that features add to those that the core allows for a key, `telemetry.clock`."""
    return tuple(word for module in brought("keys") for word in getattr(module, "WORDS", {}).get(name, ()))


def with_brought_defaults(data: Mapping[Key, Plain]) -> dict[Key, Plain]:
    """Return a scenario as written with the derived defaults of brought keys."""
    whole = dict(data)
    for each in brought_keys():
        if isinstance(group := whole.get(each.group), dict):
            whole[each.group] = each.with_defaults(group)
    return whole


def _add(group: type[OpenGroup], brought: Sequence[type[BroughtKeys]]) -> None:
    """Add keys to a group's class, each behind those that it names."""
    own: dict[str, Any] = vars(group)["__annotations__"]
    placed = in_order(list(own), brought)
    added = {name: field for each in brought for name, field in each.fields().items()}
    types = {name: added[name][0] if name in added else own[name] for name in placed}
    own.clear()
    own.update(types)
    for name, (_, default) in added.items():
        setattr(group, name, default)


def in_order(own: Sequence[str], brought: Sequence[type[BroughtKeys]]) -> list[str]:
    """Return the names of a group's keys in their order.

    Raises:
        ValueError: a name is there twice, or keys are behind none that is there.
    """
    names, waiting = list(own), list(brought)
    known = {*names, *(name for each in waiting for name in vars(each)["__annotations__"])}
    while waiting:
        ready = (each for each in waiting if {*each.after} & {*names} and {*each.after} & known <= {*names})
        if (one := next(ready, None)) is None:
            raise ValueError(f"found keys {', '.join(map(str, waiting))} that are behind no key of their group")
        waiting.remove(one)
        at = 1 + max(names.index(name) for name in one.after if name in names)
        names[at:at] = vars(one)["__annotations__"]
    if len({*names}) < len(names):
        raise ValueError(f"found a key twice among {', '.join(names)}")
    return names
