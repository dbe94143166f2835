"""Families of autopilots are folders, found by being there."""

from __future__ import annotations

from typing import get_args

import pytest

from formation_scenario.vehicles import Family
from gcs_formation.errors import RunAbortedError
from gcs_formation.extend import autopilots


def test_every_name_that_a_scenario_may_say_has_its_class() -> None:
    assert set(autopilots.FAMILIES) == set(get_args(Family))


def test_our_classes_are_attributes_by_their_names_also_those_that_families_have_in_common() -> None:
    assert autopilots.Px4Copter is autopilots.family_named("px4_copter")
    assert issubclass(autopilots.Px4Plane, autopilots.Px4)
    assert issubclass(autopilots.ArduCopter, autopilots.ArduPilot)
    with pytest.raises(AttributeError, match=r"found Zeppelin; allowed: .*ArduPlane"):
        _ = autopilots.Zeppelin


def test_a_family_whose_folder_is_not_there_is_named(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.delitem(autopilots.FAMILIES, "px4_plane")
    wanted = "found autopilot family 'px4_plane', which isn't installed; allowed: arducopter, arduplane, px4_copter"
    with pytest.raises(RunAbortedError, match=wanted):
        autopilots.family_named("px4_plane")
