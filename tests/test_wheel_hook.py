"""What a wheel's build leaves behind."""

import tempfile
from pathlib import Path
from typing import Any

import pytest
from hatchling.bridge.app import Application

import hatch_build


@pytest.fixture
def hook(tmp_path, monkeypatch):
    monkeypatch.setattr(tempfile, "tempdir", str(tmp_path))
    monkeypatch.delenv(hatch_build.SWITCH, raising=False)
    nothing: Any = None
    return hatch_build.CompilingHook(
        str(tmp_path), {"modules": []}, nothing, nothing, str(tmp_path), "wheel", Application()
    )


def test_what_was_compiled_is_there_until_it_is_in_the_wheel_and_not_after(hook, tmp_path, monkeypatch):
    def compiled(root, modules, place):
        (place / "a.so").write_text("compiled")
        return {"a.so": place / "a.so"}

    monkeypatch.setattr(hatch_build, "compiled", compiled)
    data: dict[str, dict[str, str]] = {"force_include": {}}
    hook.initialize("standard", data)
    (path,) = data["force_include"]
    assert (data["force_include"][path], Path(path).read_text()) == ("a.so", "compiled")
    hook.finalize("standard", data, "a.whl")
    assert list(tmp_path.iterdir()) == []


def test_a_failure_to_compile_leaves_nothing(hook, tmp_path, monkeypatch):
    def compiled(root, modules, place):
        (place / "half").write_text("")
        raise SystemExit("no compiler")

    monkeypatch.setattr(hatch_build, "compiled", compiled)
    hook.initialize("standard", {"force_include": {}})
    assert list(tmp_path.iterdir()) == []


def test_an_editable_installation_has_nothing_to_remove(hook, tmp_path):
    hook.initialize("editable", {})
    hook.finalize("editable", {}, "a.whl")
    assert list(tmp_path.iterdir()) == []
