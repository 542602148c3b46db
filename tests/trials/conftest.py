"""Fixtures of the tests of a trial."""

from one_throw import direct, scene, throw, unoptimised

__all__ = ["direct", "scene", "throw", "unoptimised"]
