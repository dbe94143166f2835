"""The command `airlink-proxy`, and what the command lines of all three packages share."""
