"""TOML text: what is written is what the standard library reads."""

import tomllib

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from mitt.core.errors import InputError
from mitt.io.writing import toml_text

_TEXT = st.text(st.characters(exclude_categories=["Cs"]), max_size=20)
_PLAIN = st.one_of(
    _TEXT,
    st.booleans(),
    st.integers(-(2**63), 2**63 - 1),
    st.floats(allow_nan=False, allow_infinity=False),
)
_VALUE = st.one_of(_PLAIN, st.lists(_PLAIN, max_size=4))
_TABLE = st.recursive(
    st.dictionaries(_TEXT, _VALUE, max_size=4),
    lambda inner: st.dictionaries(_TEXT, st.one_of(_VALUE, inner), max_size=4),
    max_leaves=8,
)


def _without_empty(table: dict[str, object]) -> dict[str, object]:
    """Return a table without tables that hold nothing: TOML text has no line for them."""
    inner = {k: _without_empty(x) if isinstance(x, dict) else x for k, x in table.items()}
    return {k: x for k, x in inner.items() if x != {}}


@given(_TABLE)
def test_it_comes_back(table: dict[str, object]) -> None:
    """Any names, texts, numbers, lists and nested tables."""
    assert tomllib.loads(toml_text(table)) == _without_empty(table)


@pytest.mark.parametrize("value", [float("nan"), float("inf"), object(), [object()]])
def test_what_toml_of_ours_has_not_is_refused(value: object) -> None:
    """One line."""
    with pytest.raises(InputError, match="a finite number"):
        toml_text({"key": value})


def test_numbers_of_numpy_are_numbers() -> None:
    """Whatever their width, in lists too."""
    table = {"a": np.float64(0.1), "b": [np.float32(0.5), np.int64(-3)], "c": np.bool(True)}
    assert tomllib.loads(toml_text(table)) == {"a": 0.1, "b": [0.5, -3], "c": True}
