"""Numbers that a user's text says, read in one way everywhere.

NumPy is not imported, so that help stays light.
"""

import re

#: A whole number: its sign, and its digits without leading zeros.
_WHOLE = re.compile(r"([+-]?)0*([0-9]+)")


def whole_of(text: str) -> int | None:
    """Return the whole number that a user's text is; None where it is none.

    Digits are those of ASCII, as many as one likes: of a number of more than 100 digits the first
    100 are taken, which is beyond any range as well.
    """
    found = _WHOLE.fullmatch(text.strip(" \t"))
    return None if found is None else int(found[1] + found[2][:100])


def real_of(text: str) -> float | None:
    """Return the real number that a user's text is, infinity and NaN included; None if none."""
    if not text.isascii() or "_" in text:
        return None
    try:
        return float(text)
    except ValueError:
        return None
