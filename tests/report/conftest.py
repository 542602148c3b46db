"""Fixtures of the tests of pages and figures."""

from pathlib import Path

import pytest
from one_throw import direct, scene, throw, unoptimised
from small_study import TEXT, write_study

from mitt.lab.trials.catch_study import CatchStudy

__all__ = ["direct", "scene", "study", "throw", "unoptimised"]


@pytest.fixture
def study(tmp_path: Path) -> CatchStudy:
    """A study of twelve throws, each a chunk."""
    return write_study(tmp_path, TEXT)
