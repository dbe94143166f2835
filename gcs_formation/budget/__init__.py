"""What the station and its vehicles put on the air: rates no higher than needed, lower where a link is full."""
