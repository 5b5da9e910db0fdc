"""A result as one page for a browser, without a network: the room to turn, the cameras' images, curves and a time line."""
