"""A tick in which the ball follows a path or its flight is disturbed: made step by step."""

from mitt.signals import TICK, Array
from mitt.world import motion
from mitt.world.contacts import BALL_ANY
from mitt.world.engine import Plant
from mitt.world.faults.trial import ActiveFaults
from mitt.world.flights import BallPath


def move(
    plant: Plant, tau: Array, hand: float, rows: Array, *, path: BallPath | None,
    faults: ActiveFaults | None,
) -> BallPath | None:  # fmt: skip
    """Make a tick; a ball that is neither led nor disturbed flies as in :mod:`mitt.world.motion`.

    From its first touch or disturbance on, a ball that followed a path flies freely.

    Args:
        plant: The plant.
        tau: Torques commanded [N m], shape (n,).
        hand: Closing angle commanded [rad].
        rows: The trace, a row of which is written.
        path: What the ball follows; None where it flies freely.
        faults: What goes wrong in the trial; None for nothing.

    Returns:
        What the ball follows from now on.
    """
    state, ball = plant.state, len(plant.ctrl)
    start, steps = int(state[motion.TICKS]) * TICK, int(state[motion.STEPS])
    pushed = (
        faults is not None and state[motion.TOUCHED] < 0.0 and faults.pushes(start, start + TICK)
    )
    if path is None and not pushed:
        motion.move(plant, tau, hand, rows)
        return None
    h, r, dr = TICK / steps, plant.qpos[ball : ball + 3], plant.qvel[ball : ball + 3]
    motion.begin(plant, tau, hand)
    for step in range(1, steps + 1):
        flies = pushed and state[motion.TOUCHED] < 0.0
        if faults and flies and faults.push(start + (step - 1) * h, h, r, dr):
            path = None
        motion.leave(plant)
        if path is not None:
            r[:], dr[:] = path.at(start + step * h)
        if motion.arrive(plant, start + step * h) & BALL_ANY:
            path = None
    state[motion.TICKS] += 1.0
    motion.note(plant, rows)
    return path
