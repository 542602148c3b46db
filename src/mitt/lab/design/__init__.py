"""Finding what an arm can catch, and the map that does it."""
