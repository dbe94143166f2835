"""The control cycle: what its stages share, their order, and what brings further ones."""
