import signal
import subprocess
import sys

import pytest


@pytest.mark.usefixtures("foreground")
@pytest.mark.parametrize("command", ["airlink", "gcs_formation", "sim_vehicles"])
def test_ctrl_c_while_a_command_is_imported_ends_it_with_130_and_no_word(command: str) -> None:
    begun = f"from {command}.__main__ import main; import signal, sys; sys.modules['click'] = Interrupting(); main()"
    stub = "class Interrupting:\n    def __getattr__(self, name): signal.raise_signal(signal.SIGINT)\n"
    done = subprocess.run([sys.executable, "-c", f"{stub}{begun}"], capture_output=True, text=True, check=False)
    assert (done.returncode, done.stdout, done.stderr) == (128 + signal.SIGINT, "", "")
