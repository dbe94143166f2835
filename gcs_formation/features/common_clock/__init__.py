"""One clock for the stamps of all vehicles: the UTC that most of them agree on."""
