"""Which shapes may meet, named one by one: MuJoCo then has only this list to go through.

It would find them by itself, from the kinds of the shapes and a sweep over all bodies in each
step; with so few shapes that takes twice as long. Contacts are the same, and in the same order.
"""

from itertools import combinations

import mujoco
import numpy as np

from mitt.errors import ModelError


def meeting(model: mujoco.MjModel) -> list[tuple[int, int]]:
    """Return the pairs of geoms that may touch: those that are named, and those of MuJoCo's rules.

    These are: kinds that meet, not of one body, of parent and child, or of an excluded pair of
    bodies.
    """
    named = {(int(a), int(b)) for a, b in zip(model.pair_geom1, model.pair_geom2, strict=True)}
    return [
        (a, b) for a, b in combinations(range(model.ngeom), 2)
        if _meet(model, a, b) or (a, b) in named or (b, a) in named
    ]  # fmt: skip


def name_pairs(spec: mujoco.MjSpec) -> mujoco.MjModel:
    """Compile a scene whose shapes meet by name alone, as they would by their kinds.

    What two shapes are to each other is what MuJoCo takes from them: the settings of the one of
    higher priority, or else the larger of their dimensions and frictions and the mean of their
    times and dampings.
    """
    model = spec.compile()
    _refuse_own_settings(model)
    named = {frozenset((pair.geomname1, pair.geomname2)) for pair in spec.pairs}
    for a, b in meeting(model):
        names = [model.geom(g).name for g in (a, b)]
        if frozenset(names) in named:
            continue
        rank = model.geom_priority[[a, b]]
        which = [(a, b)[int(rank.argmax())]] if rank[0] != rank[1] else [a, b]
        slide, spin, roll = model.geom_friction[which].max(axis=0)
        pair = spec.add_pair(geomname1=names[0], geomname2=names[1])
        pair.condim = int(model.geom_condim[which].max())
        pair.friction = [slide, slide, spin, roll, roll]
        pair.solref = model.geom_solref[which].mean(axis=0)
    model = spec.compile()
    meet_by_name(model)
    return model


def _refuse_own_settings(model: mujoco.MjModel) -> None:
    """Refuse shapes with settings of contacts that named pairs would not take from them.

    Raises:
        ModelError: A shape has a ``solimp``, ``margin`` or ``gap`` of its own, or a ``solref`` that
            states stiffness.
    """
    usual = np.all(model.geom_solimp == model.geom_solimp[0])
    stiff = np.any(model.geom_solref[:, 0] <= 0.0)
    if not usual or stiff or np.any(model.geom_margin) or np.any(model.geom_gap):
        raise ModelError("scene", "shapes with the usual solimp, margin, gap and solref", "others")


def meet_by_name(model: mujoco.MjModel) -> None:
    """Take the kinds from a model's bodies; ``mj_setConst`` brings them back from its geoms."""
    model.body_contype[:], model.body_conaffinity[:] = 0, 0


def _meet(model: mujoco.MjModel, a: int, b: int) -> bool:
    """Say whether MuJoCo looks for contacts of two geoms of which no pair is named."""
    kinds, meets = model.geom_contype, model.geom_conaffinity
    bodies = model.geom_bodyid[a], model.geom_bodyid[b]
    first, second = (model.body_weldid[x] for x in bodies)
    parents = [model.body_weldid[model.body_parentid[x]] for x in (first, second)]
    kindred = first != 0 and second != 0 and (parents[0] == second or parents[1] == first)
    excluded = (int(min(bodies)) << 16) + int(max(bodies)) in model.exclude_signature
    wanted = kinds[a] & meets[b] or kinds[b] & meets[a]
    return bool(wanted) and first != second and not kindred and not excluded
