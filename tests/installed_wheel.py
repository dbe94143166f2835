"""Flies an installed wheel: it must be compiled, and fly a formation with a law from a file.

`python tests/installed_wheel.py`, in an environment with the wheel alone, from anywhere.
"""

from __future__ import annotations

import os
import sys
from pathlib import Path
from tempfile import TemporaryDirectory

ROOT = Path(__file__).resolve().parents[1]
sys.path[:] = [each for each in sys.path if Path(each or ".").resolve() not in {ROOT, ROOT / "tests"}]


def main() -> int:
    """Fly; return the exit status."""
    import gcs_formation  # noqa: PLC0415 - not the source tree beside this file
    from airlink.cli import COMPILED  # noqa: PLC0415

    wanted = os.environ.get("GCS_FORMATION_COMPILE", "1") != "0"
    if wanted != COMPILED:
        sys.stderr.write(f"found {'a' if COMPILED else 'no'} compiled wheel: {gcs_formation.__file__}\n")
        return 1
    scenario, own_law = ROOT / "configs" / "quickstart.yaml", ROOT / "examples" / "extensions" / "lqr_law.py"
    for law in ("fuzzy_pid", "lqr"):
        with TemporaryDirectory() as scratch:
            out, keys = Path(scratch) / "run", {"law.type": law}
            summary = gcs_formation.run(scenario, clock="virtual", out=out, overrides=keys, plugins=[own_law])
            sys.stdout.write(f"{summary!r}\n")
            if summary.held is False:
                return 1
    return 0


if __name__ == "__main__":
    sys.exit(main())
