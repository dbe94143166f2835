"""Keeping vehicles apart: setpoints give way where nothing else would keep the distance. docs/separation.md."""
