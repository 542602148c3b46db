"""Fuzzing that stays: a small dose in the tests, a large one by ``make soak``."""
