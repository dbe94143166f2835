"""Emulated families are folders, found by being there."""

from __future__ import annotations

import pytest

from formation_scenario.extensions import ExtensionError
from sim_vehicles import families


def test_our_classes_are_attributes_by_their_names() -> None:
    assert families.Px4Copter is families.FAMILIES["px4_copter"].made
    with pytest.raises(AttributeError, match="found Zeppelin; allowed: Copter, Plane, Px4Plane, Px4Copter"):
        _ = families.Zeppelin


def test_a_family_whose_folder_is_not_there_is_named(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.delitem(families.FAMILIES, "px4_plane")
    wanted = "found emulated family 'px4_plane', which isn't installed; allowed: arducopter, arduplane, px4_copter"
    with pytest.raises(ExtensionError, match=wanted):
        families.family_named("px4_plane")
