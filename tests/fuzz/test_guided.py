"""Preconditions of coverage-guided fuzzing: all inputs meet the same flight, and the seeds reach every handler."""

from __future__ import annotations

import copy

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from tests.fuzz.flight import Flight
from tests.fuzz.frames import LAYOUTS
from tests.fuzz.guided import COMMANDS, OURS, TARGETS, Target, one_input, parse, said, seeds


def test_a_copy_of_a_flight_flies_as_the_flight_does_and_leaves_it_alone() -> None:
    flight = Flight(8.0)
    one, before = copy.deepcopy(flight), len(flight.recorder.setpoints)
    one.run(2.0)
    assert len(flight.recorder.setpoints) == before
    flight.run(2.0)
    assert np.array_equal(np.array(one.recorder.setpoints), np.array(flight.recorder.setpoints), equal_nan=True)
    flown = [[body.state.values() for body in each.fleet.bodies] for each in (one, flight)]
    assert flown[0] == flown[1]


@given(st.binary(max_size=600))
def test_what_a_parser_finds_does_not_depend_on_the_cuts(data: bytes) -> None:
    parse(data)


@pytest.mark.slow
@pytest.mark.parametrize("target", TARGETS)
def test_the_first_inputs_are_survived(target: Target) -> None:
    take = one_input(target)
    for seed in seeds(target):
        take(seed)


def test_the_first_inputs_are_every_message_and_every_command() -> None:
    first = [said(seed)[0] for seed in seeds("vehicles")]
    assert {each.layout.message_id for each in first} == {layout.message_id for layout in LAYOUTS}
    assert all(each.flags & OURS for each in first)
    assert {each.system for each in first if each.layout.name == "COMMAND_LONG"} == set(range(len(COMMANDS)))
