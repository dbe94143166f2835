"""The leader's guidance along its path."""
