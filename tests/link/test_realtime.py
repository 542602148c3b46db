"""What is there before a loop is left alone by the garbage collector."""

import gc

from mitt.link.realtime import settle


def test_settling_freezes_what_is_there() -> None:
    """All containers that live are frozen, and those made later are not."""
    before = gc.get_freeze_count()
    mine: list[list[int]] = [[k] for k in range(100)]
    settle()
    try:
        frozen = gc.get_freeze_count()
        assert frozen >= before + len(mine)
        mine.append([0])
        assert gc.get_freeze_count() == frozen
    finally:
        gc.unfreeze()
