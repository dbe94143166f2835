import os
import subprocess
import sys
from pathlib import Path

import pytest

from airlink.cli.output_directory import default_directory, refusal


def test_a_name_is_no_path(tmp_path: Path, monkeypatch) -> None:
    monkeypatch.chdir(tmp_path)
    assert default_directory("../../a/b").parent == Path("runs")


def test_a_long_name_is_cut_between_two_characters() -> None:
    name = default_directory(80 * "\N{SMALL AIRPLANE}").name
    assert name.startswith(50 * "\N{SMALL AIRPLANE}")
    assert len(name.encode()) < 255


def test_a_taken_directory_gets_a_number(tmp_path: Path, monkeypatch) -> None:
    monkeypatch.chdir(tmp_path)
    first = default_directory("one")
    first.mkdir(parents=True)
    assert default_directory("one") != first


@pytest.mark.parametrize(
    ("encoding", "name"), [("latin-1", "\xdcn\xef _"), ("ascii", "_n_ _"), ("utf-8", "\xdcn\xef ☃")]
)
def test_letters_that_file_names_cant_have_are_replaced(encoding: str, name: str, monkeypatch) -> None:
    monkeypatch.setattr(sys, "getfilesystemencoding", lambda: encoding)
    assert default_directory("\xdcn\xef ☃").name.startswith(f"{name}-2")
    assert (refusal(Path("\xdcn\xef ☃"), overwrite=False) is None) is (encoding == "utf-8")


def test_a_directory_can_be_made_for_any_name_in_a_locale_of_ascii(tmp_path: Path) -> None:
    name = "default_directory"
    words = f"from airlink.cli.output_directory import {name}; {name}('\\xdc\\u2603').mkdir(parents=True)"
    plain = os.environ | {"LC_ALL": "C", "PYTHONUTF8": "0", "PYTHONCOERCECLOCALE": "0"}
    subprocess.run([sys.executable, "-c", words], cwd=tmp_path, env=plain, check=True)
    assert [each.name[:3] for each in (tmp_path / "runs").iterdir()] == ["__-"]


def test_a_directory_whose_name_cant_be_written_is_refused_in_words(monkeypatch) -> None:
    monkeypatch.setattr(sys, "getfilesystemencoding", lambda: "ascii")
    assert refusal(Path("r\xfcn"), overwrite=True) == (
        "found 'r\\xfcn'; allowed: a name in ascii, in which file names are written here"
    )


def test_a_name_of_letters_that_the_locale_lacks_is_refused_for_that_and_not_for_its_bytes(monkeypatch) -> None:
    """Its bytes are UTF-8, which Python decodes to surrogate escapes in that locale."""
    monkeypatch.setattr(sys, "getfilesystemencoding", lambda: "ascii")
    assert refusal(Path("r\udcc3\udcbcn"), overwrite=True) == (
        "found 'r\\udcc3\\udcbcn'; allowed: a name in ascii, in which file names are written here"
    )
