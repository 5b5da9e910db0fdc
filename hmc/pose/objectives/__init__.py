"""How well a pose fits what a frame shows of a person: one file a likelihood."""
