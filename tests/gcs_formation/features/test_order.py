"""Where stages of features stand among those of the core."""

from __future__ import annotations

from typing import Any

import pytest

from gcs_formation.core.cycle import Cycle, Stage
from gcs_formation.core.stages import ordered


def stage(called: str, *behind: str) -> Stage:
    """Return a stage that does nothing."""

    class Named(Stage):
        name = called
        after = behind

        def run(self, cycle: Cycle) -> None:
            """Do nothing."""

    made: Any = Named
    return made()


def names(core: str, *brought: Stage) -> str:
    return " ".join(each.name for each in ordered([stage(each) for each in core.split()], list(brought)))


def test_a_stage_stands_behind_what_it_names_and_before_the_next_of_the_core() -> None:
    assert names("a b c", stage("x", "a"), stage("y", "c"), stage("w", "a")) == "a w x b c y"


def test_features_name_each_other_and_may_be_left_out() -> None:
    fence, rule = stage("z_fence", "a"), stage("rule", "a", "z_fence")
    assert names("a b", rule, fence) == "a z_fence rule b"
    assert names("a b", rule) == "a rule b"


def test_one_that_waits_for_two_stands_behind_the_later() -> None:
    assert names("a b c", stage("x", "a", "b")) == "a b x c"


@pytest.mark.parametrize(
    ("brought", "found"),
    [
        ([stage("x", "gone")], "found stage x after gone; allowed: a, b"),
        ([stage("x", "a", "y"), stage("y", "a", "x")], "wait for each other: x, y"),
        ([stage("b", "a")], "of one name among a, b, b"),
    ],
)
def test_what_cannot_be_ordered_is_said(brought: list[Stage], found: str) -> None:
    with pytest.raises(ValueError, match=found):
        names("a b", *brought)
