"""Mutants of a valid file: what happens to files, and what somebody hostile would do to them."""

import numpy as np

#: What is put in the place of a word or a number.
_EVIL = (
    b"nan",
    b"NaN",
    b"inf",
    b"-inf",
    b"Infinity",
    b"1e400",
    b"-1e308",
    b"1e-400",
    b"0",
    b"-0.0",
    b"-1",
    b"1",
    b"2",
    b"99999999999999999999",
    b"0x10",
    b"1_000",
    b"true",
    b"null",
    b'""',
    b"[]",
    b"{}",
    b'"x"',
    b"1,2",
    b"#",
    b"%s%n",
    b"../../../../etc/passwd",
    b"/dev/zero",
    b"\x00",
    b"\xff\xfe",
    "\u202e\U0001f525".encode(),
    b"__import__('os')",
    b"<a/>",
    b"&lt;",
    b"'",
    b"\\",
    b"[[[[",
    b"=",
    b"\r\n",
    b"1979-05-27T07:32:00Z",
)
_SEPARATORS = b" ,=\t\n\r\"'[]{}:<>"


def mutant(valid: bytes, rng: np.random.Generator) -> bytes:
    """Return a file with one to four things wrong with it."""
    data = valid
    for _ in range(int(rng.integers(1, 5))):
        data = _KINDS[int(rng.integers(len(_KINDS)))](data, rng)
    return data[:200_000]


def _at(data: bytes, rng: np.random.Generator) -> int:
    """Return a place in the file."""
    return int(rng.integers(len(data) + 1))


def _flip(data: bytes, rng: np.random.Generator) -> bytes:
    """Flip one bit."""
    if not data:
        return data
    k = int(rng.integers(len(data)))
    return data[:k] + bytes([data[k] ^ (1 << int(rng.integers(8)))]) + data[k + 1 :]


def _cut(data: bytes, rng: np.random.Generator) -> bytes:
    """Cut the file short."""
    return data[: _at(data, rng)]


def _drop(data: bytes, rng: np.random.Generator) -> bytes:
    """Leave a piece out."""
    a, b = sorted((_at(data, rng), _at(data, rng)))
    return data[:a] + data[min(b, a + 200) :]


def _insert(data: bytes, rng: np.random.Generator) -> bytes:
    """Put something evil somewhere."""
    k = _at(data, rng)
    return data[:k] + _EVIL[int(rng.integers(len(_EVIL)))] + data[k:]


def _noise(data: bytes, rng: np.random.Generator) -> bytes:
    """Overwrite a piece with random bytes."""
    k = _at(data, rng)
    return data[:k] + rng.bytes(int(rng.integers(1, 40))) + data[k + 20 :]


def _line(data: bytes, rng: np.random.Generator) -> bytes:
    """Drop, double, swap or repeat a line many times."""
    lines = data.split(b"\n")
    a, b = (int(rng.integers(len(lines))) for _ in range(2))
    kind = int(rng.integers(4))
    if kind == 0:
        del lines[a]
    elif kind == 1:
        lines.insert(b, lines[a])
    elif kind == 2:
        lines[a], lines[b] = lines[b], lines[a]
    else:
        lines[a:a] = [lines[a]] * int(rng.integers(2, 200))
    return b"\n".join(lines)


def _word(data: bytes, rng: np.random.Generator) -> bytes:
    """Put something evil in the place of a word or a number."""
    if not data:
        return data
    a = b = int(rng.integers(len(data)))
    while a > 0 and data[a - 1] not in _SEPARATORS:
        a -= 1
    while b < len(data) and data[b] not in _SEPARATORS:
        b += 1
    return data[:a] + _EVIL[int(rng.integers(len(_EVIL)))] + data[b:]


def _deep(data: bytes, rng: np.random.Generator) -> bytes:
    """Nest something deeply."""
    k, depth = _at(data, rng), int(rng.integers(10, 3000))
    left, right = ((b"[", b"]"), (b'{"a":', b"}"), (b"<body>", b"</body>"))[int(rng.integers(3))]
    return data[:k] + left * depth + right * depth + data[k:]


def _long(data: bytes, rng: np.random.Generator) -> bytes:
    """Put a very long word somewhere."""
    k = _at(data, rng)
    word = (b"9", b"a", b"-", b" ")[int(rng.integers(4))]
    return data[:k] + word * int(rng.integers(1000, 60_000)) + data[k:]


_KINDS = (_flip, _cut, _drop, _insert, _noise, _line, _word, _word, _word, _deep, _long)
