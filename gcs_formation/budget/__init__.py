"""What the station and its vehicles put on the air: rates no higher than anybody needs, lower where a link is full."""
