"""A calculation in pieces ends as one that is done at once, and works nothing out twice."""

import pickle

import pytest
from hypothesis import given
from hypothesis import strategies as st

from mitt.core.verdict.pieces import Pieces, Unfinished

CALLS = list[str]()


def number(name: str, value: int) -> int:
    """Return a value, and note that it was worked out."""
    CALLS.append(name)
    return value


def total(pieces: Pieces, values: list[int]) -> int:
    """Return a sum of pieces, of which the last is asked for twice."""
    found = [pieces.of(f"{k}", number, f"{k}", x) for k, x in enumerate(values)]
    pieces.rest()
    again = [pieces.of(f"{k}", number, f"{k}", x) for k, x in enumerate(values)]
    return pieces.whole("all", sum, found + again[-1:])


@given(values=st.lists(st.integers(-9, 9), min_size=1, max_size=9), count=st.integers(1, 4))
def test_whatever_is_granted_the_result_is_the_same(values: list[int], count: int) -> None:
    """Each piece once, no more than are granted at a time, and kept in a file in between."""
    CALLS.clear()
    pieces, result, before = Pieces(0), None, 0
    while result is None:
        pieces.grant(count)
        try:
            result = total(pieces, values)
        except Unfinished:
            pieces = pickle.loads(pickle.dumps(pieces))  # noqa: S301 (made here)
        assert 0 <= len(CALLS) - before <= count
        before = len(CALLS)
    assert result == sum(values) + values[-1]
    assert [f"{k}" for k in range(len(values))] == CALLS
    assert total(Pieces(), values) == result


def test_with_none_granted_nothing_is_worked_out() -> None:
    """It ends at the first piece."""
    with pytest.raises(Unfinished):
        Pieces(0).of("0", number, "0", 1)
