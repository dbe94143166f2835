"""What `check` shows by flying, on the virtual clock, within a bounded wall time; never part of `run`."""
