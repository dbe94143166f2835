"""Keeps setpoints inside the fence, and heights above the ground."""
