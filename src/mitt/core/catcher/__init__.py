"""One tick: what the catcher knows, what it does each millisecond, and in which order."""
