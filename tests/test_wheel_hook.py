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
        str(tmp_path), {"modules": [], "compiling": ["mypy"]}, nothing, nothing, str(tmp_path), "wheel", Application()
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


@pytest.mark.parametrize(("switch", "needed"), [("0", []), ("1", ["mypy"]), ("", ["mypy"])])
def test_a_wheel_that_is_left_uncompiled_needs_no_compiler_of_ours(hook, monkeypatch, switch, needed):
    monkeypatch.setenv(hatch_build.SWITCH, switch)
    assert hook.dependencies() == needed


def test_a_wheel_that_must_be_compiled_and_cannot_is_an_error(hook, monkeypatch):
    def compiled(root, modules, place):
        raise SystemExit("no compiler")

    monkeypatch.setenv(hatch_build.SWITCH, "1")
    monkeypatch.setattr(hatch_build, "compiled", compiled)
    with pytest.raises(SystemExit):
        hook.initialize("standard", {"force_include": {}})
