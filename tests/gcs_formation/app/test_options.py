import math
from pathlib import Path

import pytest

from gcs_formation.app.operator import RunOptions


@pytest.mark.parametrize(
    "wrong",
    [
        {"clock": "fast"},
        {"speedup": 0.0},
        {"speedup": math.nan},
        {"until_s": -1.0},
        {"until_s": math.nan},
        {"clock": "virtual", "speedup": 2.0},
    ],
)
def test_what_the_command_line_refuses_is_refused_from_python_too(wrong) -> None:
    with pytest.raises(ValueError, match="allowed: "):
        RunOptions(Path("run"), **wrong)
