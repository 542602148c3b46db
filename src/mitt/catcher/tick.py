"""One tick, from images to torque, in one compiled call.

    perceive   encoders -> estimate_joints -> joints, shape (2, n)
               images -> localize -> position, shape (3,) -> update, predict -> ball, shape (3, 3)
    refer      ball -> reference -> desired motion of the joints, shape (6, n)
    act        desired motion -> safety_filter -> close, derate, track -> command, shape (5, n)
               assess -> health;  predict_acceleration -> what the command will cause

The kernels are those of the stages, composed; none is written a second time. All that they know
and remember lies in ``state`` and in the ``result`` of the tick before, both as handles
(:mod:`mitt.catcher.state`, :mod:`mitt.catcher.result`).

A generator that is no map takes the same way in two halves, :func:`perceive` and :func:`act`, with
its own ``reference`` between them.
"""

import numpy as np

from mitt.catcher.action import act
from mitt.catcher.perception import perceive
from mitt.catcher.result import Result
from mitt.catcher.settings import DECIDE, FOLLOW, WATCH
from mitt.catcher.state import CatcherState
from mitt.generator.evaluation import reference, time_to_catch
from mitt.generator.feasibility import level
from mitt.generator.prediction import lay_state, sigma_at_catch
from mitt.jit import kernel
from mitt.signals import Array, Image


@kernel
def tick(
    images: tuple[Image, ...],
    backgrounds: tuple[Image, ...],
    apart: int,
    t_exposed: float,
    t: float,
    t_read: float,
    q: Array,
    dq: Array,
    brake: Array,
    state: CatcherState,
    result: Result,
) -> int:
    """See, estimate, generate by the map, close, track.

    Args:
        images: One a camera, shape (height, width); empty where there is none.
        backgrounds: As of :func:`mitt.vision.localization.localize`.
        apart: Those not exposed at ``t_exposed``, a bit each.
        t_exposed: Instant of the exposure [s].
        t: Time of the tick [s].
        t_read: Time of the reading of the encoders [s].
        q: Encoders [rad], shape (n,).
        dq: Encoders [rad/s], shape (n,).
        brake: q, dq, ddq while braking, a row each tick, shape (k, 3, n).
        state: All that is known and remembered, overwritten.
        result: That of the tick before, overwritten.

    Returns:
        What is to be thought about: bits.
    """
    perceive(images, backgrounds, apart, t_exposed, t, t_read, q, dq, state, result)
    refer(state, result)
    return int(act(brake, state, result))


@kernel
def refer(state: CatcherState, result: Result) -> None:
    """Evaluate the map at the ball; while the verdict is pending, at its surrogate target."""
    s, out = state.scalars[0], result.scalars[0]
    if s.phase != FOLLOW:
        return
    target, rows = state.target, result.reference
    target[:] = result.ball
    if s.surrogate:
        level(target, s.waiting_height)
    rows[3] = state.start
    if reference(
        state.packed, state.powers, state.window, state.alpha, target, rows, state.map_work
    ):
        out.inside = True
        out.time_to_catch = time_to_catch(
            state.packed, rows, target, out.drag, out.led or s.surrogate, state.start,
            state.map_work,
        )  # fmt: skip


@kernel
def undecided(todo: int, state: CatcherState, result: Result) -> bool:
    """Say that all there is to be thought about is a verdict that cannot be given yet.

    The ball is not known well enough at its catch, and the verdict is not due; or the ball was
    far, and it is too soon to look again. Saves a compiled loop the way
    through ``Catcher.think``, which finds the same.

    Args:
        todo: What a tick returned.
        state: As for :func:`tick`.
        result: As for :func:`tick`.
    """
    s, out = state.scalars[0], result.scalars[0]
    if todo != DECIDE or s.phase != WATCH:
        return False
    if out.t_ball < s.t_look:
        return True
    if s.sigma_ready == np.inf:
        return False
    if out.t_ball - out.t_first >= s.watch:
        return False
    motion, q_o, within = np.empty(10), state.start.copy(), state.trusted
    lay_state(result.ball, out.drag, out.led, motion)
    sigma = sigma_at_catch(
        state.packed, motion, out.drag, result.covariance, within[0], within[1], q_o,
        state.map_work,
    )  # fmt: skip
    return bool(sigma > s.sigma_ready)
