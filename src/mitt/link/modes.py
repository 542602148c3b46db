"""What the live loop is about, and what it counts.

WAITING  no healthy robot yet, or nobody has said that the arm may move
MOVING   slowly to the ready pose
CATCHING a fresh catcher watches, follows, brakes and holds
STOPPING a controlled stop within all limits
STOPPED  at rest, brakes engaged, latched until a person says so
"""

from dataclasses import dataclass
from enum import Enum
from typing import final


class Mode(Enum):
    """What the loop is about."""

    WAITING = "waiting for the robot"
    MOVING = "to the ready pose"
    CATCHING = "catching"
    STOPPING = "stopping"
    STOPPED = "stopped"


@final
@dataclass(slots=True)
class Counts:
    """What happened so far.

    Attributes:
        ticks: Ticks made.
        late: Readings that had to wait for the loop.
        lost: Readings that never came.
        throws: Balls that flew past, caught or not.
        refused: Those that the catcher refused.
        stopped: Those in which it stopped.
        stray: Positions of the ball, and images, with impossible stamps.
        repeated: Readings of a moving arm, and positions of the ball, that repeat the ones before
            to the last digit: their source is slower than its publisher.
        stops: Why the arm was stopped and stayed so, each time.
    """

    ticks: int
    late: int
    lost: int
    throws: int
    refused: int
    stopped: int
    stray: int
    repeated: int
    stops: list[str]
