"""Rivals: other methods of catching, and an oracle, with the interface of a generator."""
