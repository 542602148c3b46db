"""The small study."""

from pathlib import Path

import pytest
from small_study import TEXT, write_study

from mitt.sweep.study import Study


@pytest.fixture
def study(tmp_path: Path) -> Study:
    """A study of 24 throws in twelve chunks."""
    return write_study(tmp_path, TEXT)
