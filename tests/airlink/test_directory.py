from pathlib import Path

from airlink.cli import default_directory


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
