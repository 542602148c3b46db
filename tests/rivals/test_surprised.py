"""The clairvoyant that learns of a kick when it happens: two plans without a jump between them."""

from collections.abc import Callable

import numpy as np
import pytest

from mitt.generator.learn import Learned
from mitt.rivals.clairvoyant import make_clairvoyant
from mitt.rivals.surprised import Surprised
from mitt.robot.arm import Arm
from mitt.signals import Array, BallState
from mitt.world.ballistics import fly
from mitt.world.throws import Throw

pytest.importorskip("casadi")

#: Drag of the ball [1/m], start of the arm, kick [s], and what it adds to the velocity [m/s].
DRAG, START, KICKED, CHANGE = 0.04, 0.08, 0.3, (0.0, 0.4, 0.3)
#: Agreement of the two plans where they meet [rad, rad/s], and of the catch with the ball [m].
SAME, MET = 1e-6, 2e-3


@pytest.fixture(name="told", scope="module")
def _told(learned: Learned, throw_of: Callable[[int], Throw]) -> Surprised:
    """One that will be told of a kick."""
    throw, plain = throw_of(5), make_clairvoyant(learned.map)

    def straight(t: float) -> tuple[Array, Array]:
        return fly(throw.r, throw.dr, drag=DRAG, duration=t)

    def kicked(t: float) -> tuple[Array, Array]:
        if t < KICKED:
            return straight(t)
        r, dr = straight(KICKED)
        return fly(r, dr + np.array(CHANGE), drag=DRAG, duration=t - KICKED)

    return Surprised(before=plain.told(straight), after=plain.told(kicked), when=KICKED)


def test_it_knows_nothing_before_and_all_after(
    told: Surprised, arm: Arm, ball_of: Callable[[int, float], BallState]
) -> None:
    """Until the kick it moves as for the straight flight; after it, to where the ball will be."""
    moving = told.adapt(ball_of(5, START), arm.q_ready, np.zeros(arm.n))
    assert moving.turned is not None
    first, second = moving.before.plan, moving.turned.plan
    assert first is not None
    assert second is not None
    for t in (START, 0.2, KICKED - 1e-3):
        assert np.array_equal(moving.reference(ball_of(5, t)).q_d, first.at(t)[0])
    assert np.allclose(first.at(KICKED)[:2], second.at(KICKED)[:2], atol=SAME)
    assert moving.after.flight is not None
    end = second.at(second.t_c)[0]
    assert np.linalg.norm(arm.position(end) - moving.after.flight(second.t_c)[0]) < MET
