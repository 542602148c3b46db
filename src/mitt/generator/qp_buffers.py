"""All that an online step knows and writes in one vector: few arrays cross into a kernel.

Each array of a named tuple that is handed to compiled code costs 0.3 us, and a step has forty of
them; as views of one vector they cost nothing. ``gather`` lays them one after another, ``opened``
returns them as the named tuples that the kernels take.

| here     | meaning                                                              | shape        |
|----------|----------------------------------------------------------------------|--------------|
| ``store``| all numbers, one array after another                                 | (.,)         |
| ``whole``| of each array, where it begins and its three sizes; then the joints, | (.,) int     |
|          | the exponents of the monomials and the pairs to be kept apart        |              |
"""

from collections.abc import Sequence
from typing import Any

import numpy as np
from numba.extending import register_jitable
from numpy.typing import NDArray

from mitt.generator.clearance import Space
from mitt.generator.horizon import Course
from mitt.generator.probability import assure
from mitt.generator.qp import Programme
from mitt.generator.sqp_step import Buffers, Goal, Map, begin, finish, kept
from mitt.generator.utilization import Plant, Work
from mitt.jit import kernel
from mitt.signals import Array
from mitt.views import view

Whole = NDArray[np.int64]
Known = tuple[Map, Plant, Goal, Buffers]


def gather(f: Map, p: Plant, goal: Goal, b: Buffers) -> tuple[Array, Whole]:
    """Return ``store`` and ``whole`` of the module's table, with the values that are there."""
    arrays = [
        f.packed, f.window, f.work, p.bodies, p.drives, p.scales, *goal[:4],
        *b.course, *b.programme, *b.work, b.shares, b.at, *goal.space[:4],
    ]  # fmt: skip
    sizes = [(*x.shape, 1, 1)[:3] for x in arrays]
    starts = np.cumsum([0, *(x.size for x in arrays)])
    places = [(starts[k], *size) for k, size in enumerate(sizes)]
    whole, at = (p.joints, f.powers, goal.space.pairs), 4 * (len(arrays) + 3)
    for x in whole:
        places += [(at, *(*x.shape, 1, 1)[:3])]
        at += x.size
    ends: Sequence[NDArray[np.int64]] = (np.array(places).ravel(), *(x.ravel() for x in whole))
    return np.concatenate([x.ravel() for x in arrays]), np.concatenate(ends).astype(np.int64)


@register_jitable
def _line(v: NDArray[Any], whole: Whole, k: int) -> NDArray[Any]:
    """Return the array k, of one dimension."""
    return view(v, whole[4 * k], (whole[4 * k + 1],))


@register_jitable
def _table(v: NDArray[Any], whole: Whole, k: int) -> NDArray[Any]:
    """Return the array k, of two dimensions."""
    return view(v, whole[4 * k], (whole[4 * k + 1], whole[4 * k + 2]))


@register_jitable
def _block(v: Array, whole: Whole, k: int) -> Array:
    """Return the array k, of three dimensions."""
    return view(v, whole[4 * k], (whole[4 * k + 1], whole[4 * k + 2], whole[4 * k + 3]))


@register_jitable
def opened(v: Array, w: Whole) -> Known:
    """Return map, arm, goal and buffers, whose arrays are views; in the order of ``gather``."""
    f = Map(_line(v, w, 0), _table(w, w, 37), _table(v, w, 1), _line(v, w, 2))
    p = Plant(_table(v, w, 3), _table(v, w, 4), _table(v, w, 5), _line(w, w, 36))
    space = Space(
        _table(v, w, 32), _table(v, w, 33), _line(v, w, 34), _table(v, w, 35), _table(w, w, 38)
    )
    goal = Goal(_table(v, w, 6), _table(v, w, 7), _line(v, w, 8), _table(v, w, 9), space)
    course = Course(
        _line(v, w, 10), _line(v, w, 11), _block(v, w, 12), _block(v, w, 13), _block(v, w, 14)
    )
    programme = Programme(
        _table(v, w, 15), _table(v, w, 16), _line(v, w, 17), _table(v, w, 18), _line(v, w, 19),
        _line(v, w, 20), _table(v, w, 21), _line(v, w, 22),
    )  # fmt: skip
    work = Work(
        _table(v, w, 23), _line(v, w, 24), _block(v, w, 25), _table(v, w, 26), _line(v, w, 27),
        _table(v, w, 28), _table(v, w, 29),
    )  # fmt: skip
    return f, p, goal, Buffers(course, programme, work, _table(v, w, 30), _table(v, w, 31))


@kernel
def start(
    store: Array, whole: Whole, state: Array, ahead: tuple[float, float], alpha: Array
) -> tuple[float, int, float]:
    """Begin a step; see :func:`mitt.generator.sqp_step.begin`."""
    f, p, goal, b = opened(store, whole)
    found: tuple[float, int, float] = begin(f, p, goal, state, ahead, alpha, b)
    return found


@kernel
def end(
    store: Array, whole: Whole, trial: tuple[float, float, int, float], alpha: Array, step: Array,
    moved: Array,
) -> float:  # fmt: skip
    """Finish a step; see :func:`mitt.generator.sqp_step.finish`.

    Args:
        store: All numbers.
        whole: Where they lie.
        trial: Merit of ``alpha``, share of the step that is tried first, halvings, residual of
            the continuity that is let pass.
        alpha: Coefficients now in use [rad], shape (m, n).
        step: Solution of the programme, shape (m n,).
        moved: Result, shape (m, n).

    Returns:
        The merit of ``moved``; NaN where the step is not finite or breaks the continuity.
    """
    f, p, goal, b = opened(store, whole)
    before, share, halvings, residual = trial
    if not kept(b.programme, 2 * alpha.shape[1], step, residual):
        return np.nan
    return float(finish(f, p, goal, (before, share, halvings), alpha, step, moved, b))


@kernel
def vouch(
    store: Array, whole: Whole, alpha: Array, P: Array, region: Array, tolerance: Array,
    place_: Array,
) -> tuple[tuple[int, int, int], float, float]:  # fmt: skip
    """Return the certificate of a step; see :func:`mitt.generator.probability.assure`."""
    f, p, _, b = opened(store, whole)
    found: tuple[tuple[int, int, int], float, float] = assure(
        f, p, alpha, b, P, region, tolerance, place_
    )
    return found
