"""`run --sitl` with a program in a simulator's place: it takes ArduPilot's options and flies an emulated vehicle."""

from __future__ import annotations

import json
import os
import subprocess
import sys
from pathlib import Path

import pytest
import yaml

from tests.processes import LIMIT_S, STATION, events_of, free_ports

PROGRAM = f"""#!{sys.executable}
import os, pathlib, sys
given = dict(zip(sys.argv[1:], sys.argv[2:]))
assert pathlib.Path(given["--defaults"]).read_text().count("FS_LONG_ACTN 1") == 1
_, host, port = given["--serial0"].split(":")
own = ["--vehicles", given["--sysid"], "--endpoint", f"{{given['--sysid']}}=udpout:{{host}}:{{port}}"]
command = ["-m", "sim_vehicles", os.environ["SCENARIO"], *own, "--speedup", given["--speedup"]]
pathlib.Path("pid").write_text(str(os.getpid()))
os.execv(sys.executable, [sys.executable, *command])
"""


@pytest.mark.slow
def test_simulators_are_started_flown_and_ended(tmp_path: Path) -> None:
    (program := tmp_path / "arduplane").write_text(PROGRAM)
    program.chmod(0o755)
    vehicles = [
        {"id": i, "autopilot": "arduplane", "endpoint": f"udpin:127.0.0.1:{port}", "role": role}
        for i, port, role in zip((1, 2), free_ports(2), ("leader", "follower"), strict=True)
    ]
    path = {"speed_mps": 22, "waypoints_m": [[0, 0, 100], [1500, 0, 100], [3000, 0, 100]]}
    keys = {"vehicles": vehicles, "path": path, "duration_s": 10, "start": {"run_in_s": 20}, "schema": 1}
    (file := tmp_path / "scenario.yaml").write_text(yaml.safe_dump(keys | {"name": "simulated"}))
    command = [*STATION, "run", str(file), "--sitl", f"arduplane={program}", "--speedup", "2", "--json"]
    done = subprocess.run(
        [*command, "--out", str(tmp_path / "run")],
        env=os.environ | {"SCENARIO": str(file)},
        capture_output=True,
        text=True,
        timeout=LIMIT_S,
        check=False,
    )
    assert done.returncode != 3, done.stderr
    assert json.loads(done.stdout)["followers"].keys() == {"2"}
    events = events_of(tmp_path / "run")
    assert [event["text"] for event in events if event["kind"] == "phase"][-1] == "done"
    said = [event["text"] for event in events if event["kind"] == "simulators"]
    assert said[1:] == ["no ground truth: vehicle 1, 2 has no true motion in its log"]
    for number in (1, 2):
        pid = int((tmp_path / "run" / "simulators" / str(number) / "pid").read_text())
        with pytest.raises(ProcessLookupError):
            os.kill(pid, 0)
