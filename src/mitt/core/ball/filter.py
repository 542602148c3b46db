"""The ball filter: time-stamped sightings in, an estimate of the ball's motion out.

State: position, velocity, drag coefficient k and push a; in flight ddr_o = g - k |dr_o| dr_o + a
+ noise (``flight``). Targets that do not fly are followed by other models (``motion_models``). A
track begins with a velocity as good as unknown, so that the first sightings amount to a
least-squares fit with known gravity; it speaks after ``min_sightings``.

A sighting counts at its own time, whatever the order of arrival: the ring keeps the newest
sightings, each with the estimate before it; a late one is put in its place, and all after it are
processed again. The result is that of the right order, bit for bit. A sighting too old for the
ring is dropped; one whose time was seen before changes nothing. Each sighting that is not used is
counted, by why it is not (``FilterCounts``).

No single sighting decides. One whose time is more than ``max_gap`` from the track's waits: where
``ROW`` of them come in a row, the clock was set or another throw has begun, and a new track begins
with them; one alone is dropped when the next sighting fits the time.

A place that comes again to the last digit, under a new stamp, is one of two things. A tracker that
does not see the ball sends the origin, or what it saw last; a target that stops dead is sighted at
one place from then on, where positions have few digits or no noise. Where the target was last, how
far a kick carries it, and whether it flies tell them apart: the place is dropped if it was out of
reach when it came first, or if it is the last one of a ball in flight, which does not stop in the
air. Else it counts like any other. That is judged when it arrives.

A bounce or a kick changes the velocity, not the position: after a few rejections the filter goes
back to before the first of them, forgets the velocity, and processes the sightings since then
again. If that fits no better, they were outliers, unless the rejections follow one another and the
newest of them agree: then the filter goes on from the newest sighting, or begins a new track with
them if that is farther away than a kick can carry; but not from sightings that tell no position, as
when one camera alone sees the ball. A track that does not speak yet gives way to sightings in a row
that are as many as its own, and two at least. A small kick passes the gate; it shows in innovations
that lean to one side (``motion_models.is_biased``), and the newest sightings are then processed
again with some freedom of velocity.
"""

from dataclasses import dataclass
from math import isfinite, sqrt
from typing import Annotated, final

import numpy as np

from mitt.core import checks
from mitt.core.ball.counts import FilterCounts, counts_of
from mitt.core.ball.flight import STATES, acceleration, advance_uncertain
from mitt.core.ball.motion_models import (
    FILTER,
    FLOOR,
    LEAST_VARIANCE,
    MODELS,
    RING,
    ROW,
    UNLIKELY,
    activate,
    correct_within_gate,
    deactivate,
    is_biased,
    is_sane,
    is_set,
    reset_drag_and_push,
    reset_motion,
    symmetric_inverse,
    tells_position,
)
from mitt.core.errors import InputError
from mitt.core.fields import Range, brief, check
from mitt.core.kernels import Fields, Record, big_kernel, copy, kernel
from mitt.core.signals import GRAVITY, Array, BallState, Sighting

MAX_HORIZON = 2.0
"""Farthest that an estimate is carried [s], but as long as a track's gap may be; no throw flies
longer."""
MAX_DOUBTFUL = 24
"""Sightings that are reconsidered at most when some of them were rejected."""
LOOK_BACK = 16
"""Sightings that are reconsidered when the innovations lean to one side, and among which a point
that comes back is looked for."""
SMALL_KICK = 1.0
"""Standard deviation of a velocity change that passes the gate [m/s]."""
_ELSEWHERE = 0.05
"""Distance from a point, along an axis, at which another one lies elsewhere [m]: far beyond noise
and steps of digits."""
_FLYING = 1.0
"""Speed above which what follows the flight model flies [m/s]: a ball that lies still before it is
thrown follows that model, too, until gravity shows."""


@dataclass(frozen=True, slots=True, kw_only=True)
class FilterConfig:
    """What is known beforehand of balls and of sightings.

    Attributes:
        drag_mean: Prior mean of the drag coefficient [1/m].
        drag_sigma: Its standard deviation [1/m]; 0.06 and 0.05 cover 0.036 to 0.15, thrown and
            table-tennis balls. A catcher that knows its ball says so and forecasts further.
        drag_max: Largest drag coefficient [1/m].
        drag_density: Spectral density of the drift of the drag coefficient [1/(m^2 s)].
        accel_density: Spectral density of the unmodelled acceleration [m^2/s^3].
        speed_sigma: Prior standard deviation of each velocity component [m/s].
        min_sightings: Sightings before the track speaks, and a rejection no longer ends it.
        gate: Squared Mahalanobis distance beyond which a sighting is rejected; a true one
            is in 1.5e-5 of cases at 25 (chi-squared, 3 degrees of freedom).
        first_gate: The same before the track speaks; wider, as a rejection costs the track.
        max_rejections: Rejections, with never three sightings in a row accepted, that make a
            kick; at most 8.
        max_rejection_time: Time from the first of three rejections in a row that makes one,
            too [s].
        kick_sigma: Velocity change that a kick may bring, each component [m/s].
        max_gap: Time without a sighting after which a new track begins, once three in a row have
            come; one alone as far from the track in time, before it or after it, counts for
            nothing [s].
        push_sigma: Standard deviation of each component of the push, a slowly varying acceleration
            that drag does not explain, such as the lift of a spinning ball [m/s^2].
        push_time: Its correlation time [s].
        lift_sigma: Standard deviation of each component of w, where what drag does not explain is
            the lift w x dr_o of a spin, in place of a push [1/s]; 0 for a push.
        lift_time: Its correlation time [s]: a spin lasts, but w falls with the speed, by about a
            tenth in a flight of a fast spin.
        steady_density: Spectral density of the unmodelled acceleration of what does not fly
            [m^2/s^3].
        driven_sigma: Standard deviation of each component of the acceleration of what is driven,
            by a hand or a spring [m/s^2].
        driven_time: Its correlation time [s].
        other_motion: Prior probability that the target does not fly; steady and driven share it.
        switch_time: Mean time between changes of the motion model [s].
        watchful: Whether the other models are weighted from the first sighting on; otherwise from
            when flight does not fit.
        speaks_after: Sightings after which there is an estimate; ``min_sightings`` if None.
    """

    drag_mean: Annotated[float, Range(0.0, 10.0)] = 0.06
    drag_sigma: Annotated[float, Range(0.0, 10.0)] = 0.05
    drag_max: Annotated[float, Range(1e-6, 10.0)] = 0.3
    drag_density: Annotated[float, Range(0.0, 1e3)] = 1e-5
    accel_density: Annotated[float, Range(0.0, 1e6)] = 0.01
    speed_sigma: Annotated[float, Range(1e-6, 1e3)] = 8.0
    min_sightings: Annotated[int, Range(1, 1000)] = 6
    gate: Annotated[float, Range(1e-6, 1e6)] = UNLIKELY
    first_gate: Annotated[float, Range(1e-6, 1e6)] = 100.0
    max_rejections: Annotated[int, Range(1, 8)] = 6
    max_rejection_time: Annotated[float, Range(0.0, 1.0)] = 0.008
    kick_sigma: Annotated[float, Range(0.0, 1e3)] = 6.0
    max_gap: Annotated[float, Range(1e-6, 10.0)] = 0.6
    push_sigma: Annotated[float, Range(0.0, 1e3)] = 0.0
    push_time: Annotated[float, Range(1e-6, 1e3)] = 1.0
    lift_sigma: Annotated[float, Range(0.0, 1e3)] = 0.0
    lift_time: Annotated[float, Range(1e-6, 1e4)] = 100.0
    steady_density: Annotated[float, Range(0.0, 1e6)] = 0.02
    driven_sigma: Annotated[float, Range(0.0, 1e4)] = 12.0
    driven_time: Annotated[float, Range(1e-6, 1e3)] = 0.2
    other_motion: Annotated[float, Range(0.0, 0.999)] = 0.1
    switch_time: Annotated[float, Range(1e-6, 1e6)] = 2.0
    watchful: bool = False
    speaks_after: Annotated[int | None, Range(1, 1000)] = None

    __repr__ = brief

    def __post_init__(self) -> None:
        """Refuse numbers with which the filter cannot work.

        Raises:
            InputError: A field is no number, or out of its range; ``drag_mean`` exceeds
                ``drag_max``.
        """
        check(self)
        if self.drag_mean > self.drag_max:
            raise InputError(
                "FilterConfig.drag_mean", f"at most drag_max, {self.drag_max}", self.drag_mean
            )


THROWN_BALL = FilterConfig(
    drag_mean=0.04, drag_sigma=0.005, drag_density=1e-6, accel_density=1e-4, push_sigma=0.03
)
"""For balls thrown by hand: 0.036 to 0.042 per metre, as fitted to throws, and hardly any spin."""

TABLE_TENNIS_BALL = FilterConfig(
    drag_mean=0.12, drag_sigma=0.03, accel_density=0.005, push_sigma=1.0
)
"""For table-tennis balls: 0.09 to 0.15 per metre, as fitted to flights, and visible spin."""


def fresh_filter(config: FilterConfig) -> Record:
    """Return a filter without a track, one record of type ``FILTER``, shape (1,)."""
    ball, c = np.zeros(1, FILTER), config
    speaks_after = c.min_sightings if c.speaks_after is None else c.speaks_after
    ball["settings"] = (
        c.gate,
        c.first_gate,
        c.min_sightings,
        c.max_rejections,
        c.max_rejection_time,
        c.kick_sigma,
        c.drag_max,
        c.speed_sigma,
        c.max_gap,
        speaks_after,
        c.watchful,
        c.switch_time,
    )
    other, spins = 0.5 * c.other_motion, c.lift_sigma > 0.0
    ball["models"][0] = [
        (
            GRAVITY,
            c.accel_density,
            c.drag_density,
            c.lift_sigma if spins else c.push_sigma,
            c.lift_time if spins else c.push_time,
            float(spins),
            c.drag_mean,
            c.drag_sigma,
            1.0 - c.other_motion,
        ),
        (0.0, c.steady_density, 0.0, 0.0, 1.0, 0.0, 0.0, 0.0, other),
        (0.0, c.steady_density, 0.0, c.driven_sigma, c.driven_time, 0.0, 0.0, 0.0, other),
    ]
    _forget(ball)
    return ball


def _forget(ball: Record) -> None:
    """Forget the ball; the counts go on."""
    ball["dropped"]["isolated"] += ball["waits"]
    ball["waits"] = ball["filled"] = 0
    for name in ("t", "t_seen", "t_first"):
        ball["now"][name] = -np.inf
    for name in ("used", "rejected", "in_a_row", "doubtful", "active"):
        ball["now"][name] = 0


@final
class BallFilter:
    """Tracks one ball through time-stamped sightings."""

    def __init__(self, config: FilterConfig | None = None) -> None:
        """Start without a track."""
        config = FilterConfig() if config is None else config
        self.config = checks.instance("config", config, FilterConfig)
        self._ball = fresh_filter(self.config)

    def reset(self) -> None:
        """Forget the ball; the counts go on."""
        _forget(self._ball)

    @property
    def tracked(self) -> bool:
        """Whether there is an estimate."""
        return bool(self._ball[0]["now"]["used"] >= self._ball[0]["settings"]["speaks_after"])

    @property
    def counts(self) -> FilterCounts:
        """What became of the sightings so far."""
        return counts_of(self._ball)

    def update(self, sighting: Sighting) -> None:
        """Take a sighting in at its own time, whatever the order of arrival."""
        s = checks.instance("sighting", sighting, Sighting)
        if s.found:
            update(self._ball, s.t, s.r_o, s.covariance)
        else:
            self._ball["dropped"]["unusable"] += 1

    def lift(self, t: float) -> tuple[Array, Array]:
        """Return w of the lift of a ball that may spin, by the flight model.

        Args:
            t: The time [s].

        Returns:
            w [1/s], shape (3,), and its covariance, shape (3, 3): without an estimate what is known
            beforehand, of a ball that does not spin zero.
        """
        t, b = checks.number("t", t), self._ball[0]
        far = abs(t - float(b["now"]["t"])) > MAX_HORIZON
        if not self.tracked or far or not self.config.lift_sigma > 0.0:
            return np.zeros(3), self.config.lift_sigma**2 * np.eye(3)
        x, P = np.empty(STATES), np.empty((STATES, STATES))
        carry_flight(self._ball, t, x, P)
        return x[7:], P[7:, 7:]

    def state(self, t: float) -> BallState:
        """Return the estimate carried by the flight model to ``t`` [s], near or far.

        Not tracked without an estimate, or further than ``MAX_HORIZON`` from it. Where the newest
        sightings were rejected, the covariance holds the kick that they may show.
        """
        t, b = checks.number("t", t), self._ball[0]
        motion, covariance = np.empty((3, 3)), np.empty((6, 6))
        tracked = predict(self._ball, t, motion, covariance)
        if tracked:
            doubt(self._ball, t, covariance)
        if not np.isfinite(covariance).all():
            tracked, motion[:], covariance[:] = False, 0.0, 0.0
        now = b["now"]
        return BallState(
            t=t,
            tracked=tracked,
            r_o=motion[0],
            dr_o=motion[1],
            ddr_o=motion[2],
            drag=float(b["drag"]) if tracked else 0.0,
            lift=b["lift"].copy() if tracked else np.zeros(3),
            covariance=covariance,
            t_seen=float(now["t_seen"]) if tracked else -np.inf,
            t_first=float(now["t_first"]) if tracked else -np.inf,
            led=bool(tracked and now["best"] > 0),
        )


@big_kernel
def update(ball: Record, t: float, z: Array, R: Array) -> None:
    """Process a sighting; one that is not finite, absurd, repeated or too old is dropped.

    Args:
        ball: The filter, of :func:`fresh_filter`.
        t: Time of the exposure [s]; one of another time than the track's waits.
        z: Position [m], shape (3,).
        R: Its covariance [m^2], shape (3, 3).
    """
    b = ball[0]
    now, seen = b.now, b.given
    if not (isfinite(t) and is_sane(z, R)):
        b.dropped.unusable += 1
        return
    seen.t = t
    copy(z, seen.z)
    copy(R, seen.R)
    if now.used > 0 and abs(t - now.t_seen) > b.settings.max_gap:
        if not _waited(b):
            return
        now.all_restarts += 1
        b.filled = now.used = now.doubtful = now.run = 0
        for k in range(ROW):
            _take(b, b.waiting[k])
    else:
        b.dropped.isolated += b.waits
        _take(b, seen)
    b.waits = 0


@kernel
def _waited(b: Fields) -> bool:
    """Let a sighting of another time wait; return whether it ends a row of them."""
    count = b.waits
    for k in range(count):
        apart = abs(b.given.t - b.waiting[k].t)
        if apart == 0.0:
            b.dropped.duplicate += 1
            return False
        if apart > b.settings.max_gap:
            b.dropped.isolated += count  # those before were single ones
            count = 0
            break
    b.waiting[count] = b.given
    b.waits = count + 1
    return bool(count + 1 == ROW)


@kernel
def _slot(b: Fields, age: int) -> Fields:
    """Return the slot of the sighting that is ``age`` places before the newest."""
    return b.ring[(b.newest - age) % RING]


@kernel
def _take(b: Fields, seen: Fields) -> None:
    """Put a sighting in its place, and process it and all after it; see :func:`update`."""
    age = 0
    while age < b.filled and _slot(b, age).seen.t > seen.t:
        age += 1
    if age < b.filled and _slot(b, age).seen.t == seen.t:
        b.dropped.duplicate += 1
        return
    if _comes_back(b, b.now if age == 0 else _slot(b, age - 1).before, age, seen):
        b.dropped.repeated += 1
        return
    if age > 0:
        after = _slot(b, age - 1)
        if b.filled == RING and age + after.before.doubtful >= RING:
            b.dropped.late += 1  # the ring lacks what could change
            return
        b.now = after.before
    b.newest = (b.newest + 1) % RING
    b.filled = min(b.filled + 1, RING)
    for k in range(age):
        into, origin = _slot(b, k), _slot(b, k + 1)
        into.seen = origin.seen
    slot = _slot(b, age)
    slot.seen = seen
    R = slot.seen.R
    definite = symmetric_inverse(R[0, 0], R[0, 1], R[0, 2], R[1, 1], R[1, 2], R[2, 2])[0]
    exact = 0.0 if definite else LEAST_VARIANCE
    for i in range(3):
        R[i, i] = max(R[i, i] + exact, LEAST_VARIANCE)
    for k in range(age, -1, -1):
        _process(b, k)


@kernel
def _comes_back(b: Fields, before: Fields, age: int, seen: Fields) -> bool:
    """Say whether a place was seen before, to the last digit, and the ball can not be there.

    Args:
        b: The filter.
        before: The estimate before the sighting.
        age: Its place in the ring.
        seen: The sighting.
    """
    known, elsewhere = before.used >= b.settings.min_sightings, False
    for k in range(age, min(b.filled, age + LOOK_BACK)):
        slot, apart = _slot(b, k), 0.0
        for i in range(3):
            apart = max(apart, abs(slot.seen.z[i] - seen.z[i]))
        if apart == 0.0:
            if elsewhere:
                return not (known and _in_reach(b, before, seen))
            if is_set(before.taken, k - age):
                return bool(known and _flies(before))
            return known and not is_set(before.reachable, k - age)
        elsewhere |= apart > _ELSEWHERE
    return False


@kernel
def _in_reach(b: Fields, of: Fields, seen: Fields) -> bool:
    """Say whether a kick since its newest sighting that fits can have carried the ball there."""
    dt, x, leap = seen.t - of.t, of.x[of.best], 0.0
    for i in range(3):
        leap += (x[i] + dt * x[3 + i] - seen.z[i]) ** 2
    return bool(sqrt(leap) <= 1.5 * b.settings.kick_sigma * (seen.t - of.t_seen))


@kernel
def _flies(of: Fields) -> bool:
    """Say whether an estimate is that of a ball in flight."""
    v = of.x[0, 3:6]
    return bool(of.best == 0 and v[0] * v[0] + v[1] * v[1] + v[2] * v[2] > _FLYING * _FLYING)


@kernel
def _process(b: Fields, age: int) -> None:
    """Process the sighting of a slot, after keeping the estimate before it."""
    slot = _slot(b, age)
    slot.before = b.now
    b.now.taken <<= 1
    b.now.reachable <<= 1
    if b.now.used == 0:
        if tells_position(slot.seen):
            _begin(b, slot, 0)
        else:
            b.now.all_vague += 1
    elif _try(b, slot):
        _on_accepted(b, slot, 0)
        if is_biased(b.now):
            _reconsider(b, age)
    else:
        _on_rejected(b, age)


@kernel
def _try(b: Fields, slot: Fields) -> bool:
    """Carry the estimate to a sighting; correct it, and return true, if that lies in the gate."""
    known = b.now.used >= b.settings.min_sightings
    return bool(
        correct_within_gate(b, slot.seen, b.settings.gate if known else b.settings.first_gate)
    )


@kernel
def _begin(b: Fields, slot: Fields, back: int) -> None:
    """Begin a new track at a sighting, which came ``back`` places before the newest."""
    now = b.now
    if now.used > 0:
        now.all_restarts += 1
    deactivate(b)
    now.x[0, 3:6] = 0.0
    reset_drag_and_push(b, 0)
    reset_motion(now.x[0], now.P[0], slot.seen, b.settings.speed_sigma)
    if b.settings.watchful:
        activate(b)
        for model in range(MODELS):
            now.weight[model] = b.models[model].prior
            if now.weight[model] > now.weight[now.best]:
                now.best = model
    now.t = now.t_first = slot.seen.t
    now.used = now.doubtful = 0
    _on_accepted(b, slot, back)


@kernel
def _on_accepted(b: Fields, slot: Fields, back: int) -> None:
    """Count a sighting that fits, ``back`` places before the newest; three end a doubt."""
    now = b.now
    now.taken |= 1 << back
    now.t_seen, now.run = slot.seen.t, 0
    now.used += 1
    now.all_used += 1
    if now.doubtful > 0:
        now.doubtful += 1
        now.in_a_row += 1
        if now.in_a_row == ROW or now.doubtful > MAX_DOUBTFUL:
            now.doubtful = 0


@kernel
def _on_rejected(b: Fields, age: int) -> None:
    """Count a rejected sighting; act when they are too many or last too long."""
    now, limits, most = b.now, b.settings, min(b.filled - age, MAX_DOUBTFUL)
    slot = _slot(b, age)
    now.reachable |= int(_in_reach(b, now, slot.seen))
    now.all_rejected += 1
    if now.doubtful == 0:
        now.rejected = 0
    now.doubtful += 1
    now.rejected += 1
    now.run += 1
    now.in_a_row = 0
    run, doubtful = min(now.run, most), min(now.doubtful, most)
    lasts = slot.seen.t - _slot(b, age + run - 1).seen.t
    if now.used < limits.min_sightings:
        depth = _telling(b, age, run)
        if run >= min(max(now.used, 2), limits.max_rejections) and depth > 0:
            _begin_with(b, age, depth)
    elif run >= ROW and lasts >= limits.max_rejection_time:
        _reacquire(b, age, run, run)
    elif now.rejected >= limits.max_rejections:
        _reacquire(b, age, doubtful, run)


@kernel
def _telling(b: Fields, age: int, depth: int) -> int:
    """Return how many of the newest ``depth`` sightings there are from one on that tells where."""
    while depth > 0 and not tells_position(_slot(b, age + depth - 1).seen):
        depth -= 1
    return depth


@kernel
def _begin_with(b: Fields, age: int, depth: int) -> int:
    """Begin a new track at the oldest of ``depth`` sightings; return how many of them fit it."""
    _take_back(b, depth - 1)
    _begin(b, _slot(b, age + depth - 1), depth - 1)
    return 1 + int(_fit_again(b, age, depth - 1))


@kernel
def _fit_again(b: Fields, age: int, depth: int) -> int:
    """Process the newest ``depth`` sightings again; return how many of them fit."""
    fitting = 0
    for k in range(age + depth - 1, age - 1, -1):
        slot = _slot(b, k)
        _take_back(b, k - age)
        if _try(b, slot):
            _on_accepted(b, slot, k - age)
            fitting += 1
        else:
            b.now.all_rejected += 1
    return fitting


@kernel
def _take_back(b: Fields, back: int) -> None:
    """Count a sighting out, ``back`` places before the newest, to process it again."""
    now = b.now
    if is_set(now.taken, back):
        now.all_used -= 1
        now.taken ^= 1 << back
    else:
        now.all_rejected -= 1


@kernel
def _reacquire(b: Fields, age: int, depth: int, run: int) -> None:
    """Explain the newest ``depth`` sightings: outliers, a kick, or another ball.

    The depth is the ``run`` of rejections, or reaches back to where the doubt began.
    """
    now, newest, first = b.now, _slot(b, age), _slot(b, age + depth - 1)
    kick, most = b.settings.kick_sigma, b.settings.max_rejections
    fitted = 0 if depth == run else depth - now.rejected
    far = not _in_reach(b, now, newest.seen)
    b.spare = b.now
    now.doubtful = 0
    _go_back(b, first, kick)
    fitting = _fit_again(b, age, depth)
    if 2 * fitting > depth and fitting > fitted + 1:
        now.all_kicks += 1
        return
    b.now = b.spare
    if run >= most and tells_position(newest.seen):
        size = _telling(b, age, most)
        agreeing = _begin_with(b, age, size)
        if far and 2 * agreeing > most:
            return
        b.now = b.spare
        if far or 2 * agreeing <= size:
            return
        now.all_kicks += 1  # go on from the newest, with a velocity as good as unknown
        reset_motion(now.x[now.best], now.P[now.best], newest.seen, kick)
        activate(b)
        now.doubtful = 0
        _take_back(b, 0)
        _on_accepted(b, newest, 0)
    elif depth != run:
        now.doubtful = 0


@kernel
def _reconsider(b: Fields, age: int) -> None:
    """Weight all motion models, and a small kick, on the newest sightings."""
    depth = min(LOOK_BACK, b.filled - age, b.now.used - 1)
    if depth < 1:
        return
    _go_back(b, _slot(b, age + depth - 1), SMALL_KICK)
    for k in range(age + depth - 1, age - 1, -1):
        _try(b, _slot(b, k))


@kernel
def _go_back(b: Fields, first: Fields, kick: float) -> None:
    """Go back to the estimate before a sighting, its velocity changed by a kick [m/s]."""
    now, past = b.now, first.before
    best = past.best
    copy(past.x[best], now.x[best])
    copy(past.P[best], now.P[best])
    now.t, now.best, now.active = past.t, best, past.active
    if now.active:
        for model in range(MODELS):
            now.weight[model] = past.weight[model]
    # When within the gap the kick came is unknown, and so how far it has carried the ball.
    P, gap = now.P[best], first.seen.t - now.t
    if best == 0 and kick > SMALL_KICK and b.models[0].spins > 0.0:  # a bounce changes the spin
        for i in range(7, STATES):
            P[i, :] = 0.0
            P[:, i] = 0.0
            P[i, i] = b.models[0].push_sigma ** 2
    for i in range(3):
        P[i, i] += (kick * gap) ** 2
        P[3 + i, 3 + i] += kick**2
    activate(b)


@kernel
def predict(ball: Record, t: float, motion: Array, covariance: Array) -> bool:
    """Carry the estimate to an instant, without changing it.

    Args:
        ball: The filter, of which only scratch and ``drag`` are changed.
        t: The instant [s].
        motion: Result: position, velocity, acceleration [m, m/s, m/s^2], shape (3, 3).
        covariance: Result, covariance of position and velocity, shape (6, 6).

    Returns:
        Whether the ball is tracked; if not, or further than ``MAX_HORIZON`` from the last
        sighting, or beyond sightings that wait, the results are zero. The drag coefficient is in
        ``drag``.
    """
    b = ball[0]
    origin = _estimate_for(b, t)
    dt = t - origin.t
    motion[:, :] = 0.0
    covariance[:, :] = 0.0
    farthest = max(MAX_HORIZON, b.settings.max_gap)
    tracked = b.now.used >= b.settings.speaks_after and abs(dt) <= farthest
    if not tracked or _is_of_others(b, t):
        return False
    best, active, x, P = origin.best, origin.active, b.work.x, b.work.P
    _carry(b, origin, best, dt)
    copy(x[:3], motion[0])
    copy(x[3:6], motion[1])
    b.drag = x[6]
    acceleration(motion[1], x[6], motion[2])
    spins = b.models[best].spins > 0.0
    for i in range(3):
        j, k = (i + 1) % 3, (i + 2) % 3
        b.lift[i] = x[7 + i] if spins else 0.0
        motion[2, i] += x[7 + j] * x[3 + k] - x[7 + k] * x[3 + j] if spins else x[7 + i]
    motion[2, 2] += GRAVITY - b.models[best].gravity
    _add_moment(motion, x, P, origin.weight[best] if active else 1.0, covariance)
    for model in range(MODELS):
        if active and model != best and origin.weight[model] > FLOOR:
            _carry(b, origin, model, dt)
            _add_moment(motion, x, P, origin.weight[model], covariance)
    return True


@kernel
def carry_flight(ball: Record, t: float, x: Array, P: Array) -> None:
    """Write the flight model's estimate at an instant [s], (10,), and its covariance (10, 10)."""
    b = ball[0]
    origin = _estimate_for(b, t)
    _carry(b, origin, 0, t - origin.t)
    copy(b.work.x, x)
    copy(b.work.P, P)


@kernel
def doubt(ball: Record, t: float, covariance: Array) -> None:
    """Add to the covariance of :func:`predict` what sightings say that were rejected last.

    They are outliers, or the ball was kicked at any instant since the last one that fits; the more
    of them in a row, the likelier. Either shows within ``max_rejection_time``.

    Args:
        ball: The filter.
        t: The instant [s].
        covariance: Of position and velocity at that instant, overwritten, shape (6, 6).
    """
    b = ball[0]
    origin = _estimate_for(b, t)
    run, since = origin.run, t - origin.t_seen
    if not (run > 0 and since > 0.0):
        return
    kick = run / (run + 1.0) * b.settings.kick_sigma**2
    for i in range(3):
        covariance[i, i] += kick * since * since
        covariance[i, 3 + i] += kick * since
        covariance[3 + i, i] += kick * since
        covariance[3 + i, 3 + i] += kick


@kernel
def _estimate_for(b: Fields, t: float) -> Fields:
    """Return the estimate that speaks of an instant [s].

    That is the newest, but before a rejected sighting the one before it: nothing is carried
    forth to a wrong stamp, and back.
    """
    newest, now = _slot(b, 0), b.now
    if b.filled > 0 and t < now.t == newest.seen.t > now.t_seen:
        return newest.before
    return now


@kernel
def _is_of_others(b: Fields, t: float) -> bool:
    """Say whether an instant lies at or beyond sightings that wait, seen from the track."""
    if b.waits == 0:
        return False
    if b.waiting[0].t > b.now.t_seen:
        return bool(t >= b.waiting[0].t)
    return bool(t <= b.waiting[b.waits - 1].t)


@kernel
def _carry(b: Fields, origin: Fields, model: int, dt: float) -> None:
    """Carry a copy of a model's track, in the scratch, from an estimate on by ``dt`` [s]."""
    work = b.work
    copy(origin.x[model], work.x)
    copy(origin.P[model], work.P)
    advance_uncertain(work.x[:], work.P[:], dt, b.models[model], work.A, work.FP)


@kernel
def _add_moment(motion: Array, x: Array, P: Array, weight: float, covariance: Array) -> None:
    """Add the second moment of one model's estimate about ``motion``, weighted."""
    for i in range(6):
        for j in range(i + 1):
            d_i, d_j = x[i] - motion[i // 3, i % 3], x[j] - motion[j // 3, j % 3]
            covariance[i, j] += weight * (P[i, j] + d_i * d_j)
            covariance[j, i] = covariance[i, j]
