from pathlib import Path

from airlink.cli import default_directory


def test_a_name_is_no_path(tmp_path: Path, monkeypatch) -> None:
    monkeypatch.chdir(tmp_path)
    assert default_directory("../../a/b").parent == Path("runs")


def test_a_taken_directory_gets_a_number(tmp_path: Path, monkeypatch) -> None:
    monkeypatch.chdir(tmp_path)
    first = default_directory("one")
    first.mkdir(parents=True)
    assert default_directory("one") != first
