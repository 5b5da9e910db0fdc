"""How well a pose explains what a frame shows of a person: one file a likelihood."""
