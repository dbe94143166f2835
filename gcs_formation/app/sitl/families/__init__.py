"""The simulators that can be started, a module each, found by being here."""
