"""Parameter files as ground stations write them: every format gives the same, and what is none is refused in place."""

from __future__ import annotations

import os
from contextlib import suppress
from pathlib import Path

import pytest
from hypothesis import given
from hypothesis import strategies as st

from formation_scenario.parameter_files import ParameterFileError, read_parameters
from formation_scenario.parameter_files.text import MAX_BYTES, parse

VALUES = {"AIRSPEED_MIN": 11.0, "TECS_TIME_CONST": 4.5, "CAN_D1_UC_ESC_BM": 15.0}
FORMATS = {
    "Mission Planner": "#NOTE: 1/2/2026\nAIRSPEED_MIN,11\nTECS_TIME_CONST,4.5\nCAN_D1_UC_ESC_BM,15\n",
    "MAVProxy": "AIRSPEED_MIN     11.000000\nTECS_TIME_CONST  4.500000\nCAN_D1_UC_ESC_BM 15\n",
    "tabs, Windows": "AIRSPEED_MIN\t11\r\nTECS_TIME_CONST\t4.5\r\nCAN_D1_UC_ESC_BM\t0x0F\r\n",
    "remarks": "\ufeff// mine\nAIRSPEED_MIN 11 # m/s\n\n  TECS_TIME_CONST = 4.5  was 5\nCAN_D1_UC_ESC_BM 15 @READONLY",
    "QGroundControl": (
        "# Onboard parameters for Vehicle 1\n# Vehicle-Id Component-Id Name Value Type\n"
        "1\t1\tAIRSPEED_MIN\t11.000000000000000000\t9\n1\t1\tTECS_TIME_CONST\t4.5\t9\n1\t1\tCAN_D1_UC_ESC_BM\t15\t6\n"
    ),
}


@pytest.mark.parametrize("name", FORMATS)
def test_every_format_gives_the_same_values(tmp_path: Path, name: str) -> None:
    (tmp_path / "plane.parm").write_text(FORMATS[name], encoding="utf-8")
    found = read_parameters(tmp_path / "plane.parm").parameters
    assert {key: each.value for key, each in found.items()} == VALUES


def test_lines_and_types_are_known() -> None:
    found = parse(FORMATS["QGroundControl"], "plane.params").parameters
    assert [(each.line, each.type) for each in found.values()] == [(3, 9), (4, 9), (5, 6)]


def test_the_last_value_of_a_name_counts_as_when_they_are_set_one_after_another() -> None:
    assert parse("AIRSPEED_MIN 9\nairspeed_min 12\n", "f").parameters["AIRSPEED_MIN"].value == 12.0


def test_what_isnt_followed_is_said() -> None:
    found = parse("@include ../plane.parm\nTHIS_NAME_IS_TOO_LONG 1\nAIRSPEED_MIN 9\n", "f")
    assert list(found.parameters) == ["AIRSPEED_MIN"]
    assert found.directives == (
        "line 1: @include ../plane.parm",
        "line 2: THIS_NAME_IS_TOO_LONG, longer than a parameter's name",
    )


@pytest.mark.parametrize(
    ("text", "said"),
    [
        ("AIRSPEED_MIN 9\nAIRSPEED_MAX\n", "f: line 2: found 'AIRSPEED_MAX'; allowed: NAME VALUE"),
        ('{"AIRSPEED_MIN": 9}', "f: line 1: found"),
        ("AIRSPEED_MIN nine\n", "f: line 1: AIRSPEED_MIN: found 'nine'; allowed: a number"),
        ("AIRSPEED_MIN nan\n", "allowed: a number"),
        ("AIRSPEED_MIN 1e999\n", "allowed: a number"),
        ("# nothing\n", "f: found no parameter; allowed: lines with"),
        ("\n".join(f"P{index} 1" for index in range(10_001)), "f: line 10001: found more than 10000 parameters"),
    ],
)
def test_what_is_no_parameter_is_refused_with_its_line(text: str, said: str) -> None:
    with pytest.raises(ParameterFileError) as refused:
        parse(text, "f")
    assert said in str(refused.value)


@given(st.binary(max_size=300))
def test_no_bytes_end_in_anything_but_parameters_or_a_refusal(raw: bytes) -> None:
    with suppress(ParameterFileError):
        assert parse(raw.decode("utf-8-sig", "replace"), "f").parameters


def test_files_are_read_bounded(tmp_path: Path) -> None:
    (tmp_path / "long.parm").write_bytes(b"# \n" * (MAX_BYTES // 3 + 1))
    for path, said in ((tmp_path / "long.parm", "longer than 2 MB"), (Path(os.devnull), "is a device")):
        with pytest.raises(ParameterFileError, match=said):
            read_parameters(path)
