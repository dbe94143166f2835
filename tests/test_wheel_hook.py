"""What a wheel's build leaves behind."""

import shutil
import subprocess
import tempfile
from importlib.metadata import version
from pathlib import Path
from typing import Any

import pytest
from hatchling.bridge.app import Application

import hatch_build
from airlink.installed import commit_of, installed_version


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
    data: dict[str, Any] = {"force_include": {}}
    hook.initialize("standard", data)
    hook.finalize("standard", data, "a.whl")
    assert list(tmp_path.iterdir()) == []
    assert data == {"force_include": {}}, "a wheel that isn't tagged as one that is compiled"


@pytest.mark.parametrize("made", [[], ["a/b.cpython-311-x86_64-linux-gnu.so"], ["a/b.pyd", "a/c.so", "d__mypyc.so"]])
def test_a_wheel_is_called_compiled_only_if_every_module_is(tmp_path, monkeypatch, made):
    built = {name: tmp_path / name for name in made}
    monkeypatch.setattr("hatch_build.runpy.run_path", lambda _: {"compiled": lambda *_: built})
    if len(made) == 3:
        assert hatch_build.compiled(tmp_path, ["a/b.py", "a/c.py"], tmp_path) == built
    else:
        with pytest.raises(RuntimeError, match=r"these weren't compiled: .*a/c\.py"):
            hatch_build.compiled(tmp_path, ["a/b.py", "a/c.py"], tmp_path)


@pytest.fixture
def clone(tmp_path):
    """A clone with one commit, and its name."""
    root = tmp_path / "clone"
    (root / "airlink").mkdir(parents=True)
    shutil.copy(Path(hatch_build.__file__).parent / hatch_build.INSTALLED, root / "airlink")
    (root / "pyproject.toml").write_text("")
    git(root, "init", "-q")
    git(root, "commit", "-q", "--allow-empty", "-m", "first")
    return root, git(root, "rev-parse", "HEAD")


def git(root, *told):
    named = ["-c", "user.name=a", "-c", "user.email=a@b.c"]
    return subprocess.run(["git", "-C", root, *named, *told], check=True, capture_output=True, text=True).stdout.strip()


def test_a_wheel_of_a_clone_knows_its_commit_compiled_or_not(hook, clone, monkeypatch):
    root, commit = clone
    monkeypatch.setenv(hatch_build.SWITCH, "0")
    monkeypatch.setattr(type(hook), "root", str(root))
    data: dict[str, Any] = {"force_include": {}}
    hook.initialize("standard", data)
    ((path, place),) = data["force_include"].items()
    assert (place, Path(path).read_text()) == ("airlink/COMMIT", f"{commit[:8]}\n")
    hook.finalize("standard", data, "a.whl")
    assert not Path(path).exists()


def test_an_installation_says_of_which_commit_it_is_while_its_clone_moves_on(clone):
    root, commit = clone
    assert installed_version(root / "airlink") == f"{version('gcs-formation')}+g{commit[:8]}"
    git(root, "commit", "-q", "--allow-empty", "-m", "second")
    second = git(root, "rev-parse", "HEAD")
    assert commit_of(root / "airlink") == second[:8] != commit[:8]
    git(root, "pack-refs", "--all")
    assert commit_of(root / "airlink") == second[:8], "in packed-refs"
    git(root, "checkout", "-q", commit)
    assert commit_of(root / "airlink") == commit[:8], "detached"
    git(root, "worktree", "add", "-q", "-b", "aside", root.parent / "aside", second)
    (root.parent / "aside" / "pyproject.toml").write_text("")
    assert commit_of(root.parent / "aside" / "airlink") == second[:8], "a worktree"
    (root / "airlink" / "COMMIT").write_text("0123abcd\n")
    assert commit_of(root / "airlink") == "0123abcd", "of a wheel"


def test_outside_of_a_clone_of_ours_there_is_no_commit(clone, tmp_path):
    (tmp_path / "a" / "airlink").mkdir(parents=True)
    assert installed_version(tmp_path / "a" / "airlink") == version("gcs-formation")
    (clone[0] / "pyproject.toml").unlink()
    assert commit_of(clone[0] / "airlink") == "", "site-packages in somebody else's clone"


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
