"""Figures and one self-contained page of a finished run."""
