"""Which of several bright things that two cameras see is a thrown ball: the one that flies.

| here     | meaning                                                     | shape   |
|----------|-------------------------------------------------------------|---------|
| tracks   | records of ``TRACK``, the candidates                        | (MOST,) |
| now      | time since the search began [ticks]                         |         |
| pair     | targets of the two cameras, by their numbers                | 2       |
"""

from math import sqrt

import numpy as np

from mitt.core.kernels import Fields, Record, kernel
from mitt.core.signals import Array

MOST = 6
"""Targets of a camera, and candidates, that are followed: those most like a thrown ball."""
SLOW = 0.002
BLUR = 0.01
"""Distance in a tick [m] below which a candidate may be a ball that rolls, 2 m/s; what the noise of
two positions adds to a distance [m]."""
LEAP = 0.05
FARTHER = 0.012
"""Most distance in a tick, and what each further tick without a frame adds [m]: 12 m/s."""

TRACK = np.dtype(
    [
        ("r", float, (3,)),
        ("start", float, (3,)),  # last and first position [m]
        ("first", float),
        ("last", float),  # when, since the search began [ticks]
        ("seen", np.int64),
        ("pair", np.int64, (2,)),  # in how many it was seen, its targets
    ]
)
"""A candidate for the ball."""


@kernel
def extend_track(
    tracks: Record, count: int, now: float, r: Array, pair: tuple[int, int], near: bool
) -> tuple[int, bool]:
    """Take a position into the track that it goes on with, or a new one.

    Where there is no room, it takes the place of the one least like a thrown ball.

    Args:
        tracks: Candidates.
        count: Their number.
        now: Time since the search began [ticks].
        r: The position [m], shape (3,).
        pair: Targets of the two cameras.
        near: Whether it is to go on with a track that hardly moves, or none.

    Returns:
        The number of candidates, and whether it was taken.
    """
    least, best = np.inf, -1
    for k in range(count):
        gap, away = now - tracks[k].last, 0.0
        for i in range(3):
            away += (tracks[k].r[i] - r[i]) ** 2
        most = LEAP if near else LEAP * gap
        if not near and gap > 1.0:
            most = LEAP + FARTHER * (gap - 1.0)
        if gap > 0.0 and sqrt(away) < min(most, least * gap):
            best, least = k, sqrt(away) / gap
    if near and best < 0:
        return count, False
    begins = best < 0
    if begins:
        best = count if count < len(tracks) else _slowest(tracks, now)
    track = tracks[best]
    if begins:
        track.first, track.seen = now, 0
        for i in range(3):
            track.start[i] = r[i]
    for i in range(3):
        track.r[i] = r[i]
    track.last, track.pair[0], track.pair[1] = now, pair[0], pair[1]
    track.seen += 1
    return max(count, best + 1), True


@kernel
def _speed(track: Fields) -> float:
    """Return how far a track moved in a tick [m]."""
    moved = 0.0
    for i in range(3):
        moved += (track.r[i] - track.start[i]) ** 2
    return float(sqrt(moved) / max(track.last - track.first, 1.0))


@kernel
def _slowest(tracks: Record, now: float) -> int:
    """Return the track least like a thrown ball: lost for some frames, or else the slowest."""
    worst, least, newest = 0, np.inf, 0.0
    for k in range(len(tracks)):
        newest = max(newest, tracks[k].last)
    for k in range(len(tracks)):
        lost = tracks[k].last < newest - 3.0 * max(now - newest, 1.0)
        speed = -1.0 if lost else _speed(tracks[k])
        if speed < least:
            worst, least = k, speed
    return worst


@kernel
def fastest_track(tracks: Record, count: int, slow: bool, enough: int) -> int:
    """Return the track that moved fastest, or -1; one that may be a rolling ball if ``slow``.

    It was seen in ``enough`` frames.
    """
    best, speed = -1, -1.0
    for k in range(count):
        track = tracks[k]
        one, ticks = _speed(track), max(track.last - track.first, 1.0)
        if not slow and one * ticks < BLUR + SLOW * ticks:
            continue
        if track.seen >= enough and one > speed:
            best, speed = k, one
    return best
