"""Benchmarks: each prints a table in Markdown. README.md has the commands."""
