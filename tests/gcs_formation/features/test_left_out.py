"""A feature is a folder, and so is a family: deleted, and nothing else edited, the core imports and flies.

The keys that a feature brings are unknown then, and those of the others aren't.
"""

from __future__ import annotations

import json
import os
import shutil
import subprocess
import sys
from pathlib import Path

import pytest

from formation_scenario.brought_keys import brought_keys
from formation_scenario.feature_folders import PACKAGE, brought
from gcs_formation.core.feature import features

ROOT = Path(__file__).parents[3]
TREE = ("airlink", "flight_model", "formation_scenario", "sim_vehicles", "gcs_formation", "configs")
NAMES = tuple(features())
FLOWN = "arduplane"
"""Folder of the family that the quickstart flies."""
FAMILIES = tuple(
    each.parent.relative_to(ROOT).as_posix()
    for each in sorted(ROOT.glob("*/**/families/*/family.py"))
    if each.parent.name != FLOWN and each.relative_to(ROOT).parts[0] in TREE
)


def _feature(module: str) -> str:
    return module.removeprefix(f"{PACKAGE}.").partition(".")[0]


KEYS = {f"{each.group}.{key}": _feature(each.__module__) for each in brought_keys() for key in each.fields()}
"""The keys that features bring, each with the name of its feature."""
WORDS = {
    f"{key}={word}": _feature(module.__name__)
    for module in brought("keys")
    for key, words in getattr(module, "WORDS", {}).items()
    for word in words
}
"""The words that they bring, likewise."""
BROUGHT = KEYS | WORDS
LOAD = """
import sys
from formation_scenario.fields import ScenarioError
from formation_scenario.load import load_scenario
for key in sys.argv[1:]:
    try:
        load_scenario("configs/quickstart.yaml", [key if "=" in key else f"{key}=[[]]"])
    except ScenarioError as error:
        if "=" in key or "unknown key" in str(error):
            print(key)
"""
"""Prints which of some keys and words are unknown."""


def flown_without(tmp_path: Path, *names: str) -> dict[str, object]:
    """Fly the quickstart in a copy of the tree without some features; return the summary."""
    summary = flown_without_folders(tmp_path, *(f"gcs_formation/features/{name}" for name in names))
    assert summary["features"] == [name for name in NAMES if name not in names]
    unknown = in_copy(tmp_path, "-c", LOAD, *BROUGHT).split()
    assert unknown == [key for key, feature in BROUGHT.items() if feature in names]
    return summary


def in_copy(tmp_path: Path, *arguments: str) -> str:
    """Run Python in the copy of the tree; return what it prints."""
    copy = tmp_path / "tree"
    done = subprocess.run(
        [sys.executable, *arguments],
        cwd=copy,
        env={**os.environ, "PYTHONPATH": str(copy), "PYTHONDONTWRITEBYTECODE": "1"},
        capture_output=True,
        text=True,
        check=False,
    )
    assert done.returncode == 0, done.stderr
    return done.stdout


def flown_without_folders(tmp_path: Path, *folders: str) -> dict[str, object]:
    """Fly the quickstart in a copy of the tree without some folders; return the summary."""
    copy, out = tmp_path / "tree", tmp_path / "run"
    for each in TREE:
        shutil.copytree(ROOT / each, copy / each, ignore=shutil.ignore_patterns("*.so"))
    for folder in folders:
        shutil.rmtree(copy / folder)
    flight = ["run", "configs/quickstart.yaml", "--clock", "virtual", "--until", "4", "--set", "expect=[]"]
    in_copy(tmp_path, "-m", "gcs_formation", *flight, "--quiet", "--out", str(out))
    summary: dict[str, object] = json.loads((out / "summary.json").read_text())
    assert summary["assembled"] is True
    return summary


def test_without_any_feature_the_core_flies(tmp_path: Path) -> None:
    flown_without(tmp_path, *NAMES)


@pytest.mark.slow
@pytest.mark.parametrize("name", NAMES)
def test_without_a_feature_the_others_fly(tmp_path: Path, name: str) -> None:
    flown_without(tmp_path, name)


def test_without_any_family_but_the_one_that_is_flown_it_flies(tmp_path: Path) -> None:
    assert flown_without_folders(tmp_path, *FAMILIES)["features"] == list(NAMES)


@pytest.mark.slow
@pytest.mark.parametrize("folder", FAMILIES)
def test_without_a_family_the_others_fly(tmp_path: Path, folder: str) -> None:
    flown_without_folders(tmp_path, folder)
