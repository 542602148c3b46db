"""Studies: many throws, several generators, a grid of conditions; resumable, on any engine."""
