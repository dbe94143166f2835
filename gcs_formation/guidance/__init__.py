"""The leader's way along its path."""
