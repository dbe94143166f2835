"""The separation rule: changes setpoints where nothing else would keep vehicles apart. See docs/separation.md."""
