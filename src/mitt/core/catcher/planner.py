"""What a catcher decides between ticks: verdict, adaptation, another map, the brake."""

from contextlib import suppress
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Any, Final, final

import numpy as np

from mitt.core.arm.arm import Arm
from mitt.core.arm.shapes import clearance
from mitt.core.catcher.generators import (
    Farsighted,
    Generator,
    Leaving,
    Paced,
    Piecewise,
    Underway,
    Unoptimised,
    fits,
    fresh_for_throw,
)
from mitt.core.catcher.settings import (
    BRAKE,
    DECIDE,
    FOLLOW,
    GRASPS,
    LAGS,
    PASSES,
    PATIENCE,
    REFUSED,
    REVIEWS,
    SOON,
    STOPPED,
    WATCH,
    CatcherSettings,
)
from mitt.core.catcher.state import (
    CatcherState,
    Result,
    ball_in,
    exchange_arm,
    flight_begun,
    overwrite,
)
from mitt.core.control.envelope import speeds_of
from mitt.core.control.health import FAILED_TICKS, is_lost
from mitt.core.control.stop import plan_brake
from mitt.core.control.viability import STOP_CLEARANCE, Safety
from mitt.core.errors import MittError
from mitt.core.kernels import kernel
from mitt.core.map.prediction import HORIZON, STRIDE, flown, lay_state, sigma_at_catch
from mitt.core.signals import GRAVITY, PASSED, TICK, Array, BallState, MapStatus
from mitt.core.verdict.feasibility import Outcome, Verdict, is_far, waiting_height
from mitt.core.verdict.impact import examined, harms, speed_caps, speed_jumps
from mitt.core.verdict.pieces import Pieces, Unfinished

#: Time after which a ball that is far, or not seen, is looked at again for a verdict [s].
_LOOK_AGAIN = 0.02
#: Time after which a ball that has come back and cannot be caught yet is judged again [s].
_JUDGE_AGAIN = 0.005
PIECES: Final = 2
"""Pieces of a verdict that are worked out in a millisecond: with fewer the arm starts later."""

#: Pieces that take as long as an adaptation.
_ADAPTATION = 1
#: Age of an estimate up to which a verdict on it is gone on with [s].
_STALE = 0.1
#: How much later than it passes by a refused ball is gone for good [s]: one that is tossed up comes
#: down into the hand that throws it then.
_LANDS = 0.4
#: Share of the time in which it is back at its height that a rising ball has to be away from the
#: hand over the ground, to come down to it.
_FALLEN = 0.5
#: Verdicts with which a ball, or what stands for it, is followed.
_FOLLOWED = (Outcome.FEASIBLE, Outcome.OPEN)


@kernel
def too_early(
    t: float, begun: float, sigma: float, t_look: float, watch: float, sigma_ready: float
) -> bool:
    """Say that no verdict can be given yet: a verdict is for this flight.

    It is too soon to look again; or the ball is not known well enough at its catch, and the
    verdict is not due.

    Args:
        t: Time of the estimate [s].
        begun: When its flight began: first seen, let go or kicked [s].
        sigma: Predicted 1-sigma at the catch [m].
        t_look: Time before which there is no verdict [s].
        watch: As of :class:`CatcherSettings`, and ``sigma_ready``.
        sigma_ready: Infinite where ``sigma`` is not asked.
    """
    return bool(t < t_look or (t - begun < watch and sigma > sigma_ready))


@kernel
def undecided(todo: int, state: CatcherState, result: Result) -> bool:
    """Say that all there is to be thought about is a verdict that cannot be given yet.

    Saves a compiled loop the way through ``Catcher.think``, which finds the same.

    Args:
        todo: What a tick returned.
        state: As for :func:`mitt.core.catcher.tick.tick`.
        result: As for :func:`mitt.core.catcher.tick.tick`.
    """
    s, out, sigma = state.scalars[0], result.scalars[0], 0.0
    if todo != DECIDE or s.phase != WATCH or s.ponders:
        return False
    if s.sigma_ready < np.inf and out.t_ball >= s.t_look:
        motion = np.empty(10)
        lay_state(result.ball, out.drag, out.led, motion)
        sigma = sigma_at_catch(state.map, motion, out.drag, result.covariance)
    begun = flight_begun(s.t_flight, out.t_first)
    return bool(too_early(out.t_ball, begun, sigma, s.t_look, s.watch, s.sigma_ready))


def comes(ball: BallState, hand: Array, floor: float) -> bool:
    """Say whether a ball comes to a hand, by where it is and how it moves now.

    It is above the floor, and going on as it does it would be at the hand in a while. One that is
    above the hand and still rises comes where it nears the hand over the ground, and is not there
    long before it has fallen: one that sprang off the hand goes on above it.

    Args:
        ball: Estimate of the ball.
        hand: Where the hand is [m], shape (3,).
        floor: Height of the floor [m].
    """
    away, dr = ball.r_o - hand, ball.dr_o
    if ball.r_o[2] < floor:
        return False
    if away[2] > 0.0 and dr[2] > 0.0:
        falls = 2.0 * dr[2] / GRAVITY
        away, dr = away[:2], dr[:2]
        if -(away @ dr) < _FALLEN * falls * (dr @ dr):
            return False
    return bool(-(away @ dr) * HORIZON > away @ away)


@final
@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class _Inquiry:
    """A verdict that is being worked out.

    Attributes:
        asked: What it was asked for, a bit of those that a tick returns: ``DECIDE``, of a ball that
            is not followed yet; ``LAGS`` and ``PASSES``, of one that is; ``REVIEWS``, of one that
            no catch is foreseen of.
        ball: Estimate of the ball when it was asked.
        begun: When its flight began [s].
        start: q, dq of the arm then [rad, rad/s], shape (2, n).
        pieces: What is known.
    """

    asked: int
    ball: BallState
    begun: float
    start: Array
    pieces: Pieces


@final
class Planner:
    """Decides for a catcher, whose state it writes; one object a throw.

    Attributes:
        generator: What makes the reference, as adapted last.
        brake: q, dq, ddq while braking, a row each tick, shape (k, 3, n).
        failure: What the generator, or a plan, failed with; nothing where none did.
        certificate: What the map as refined last says of the catch; None where none was refined.
    """

    def __init__(
        self,
        arm: Arm,
        generator: Generator,
        settings: CatcherSettings,
        state: CatcherState,
        result: Result,
    ) -> None:
        """Take what a catcher is made of, its state and its result."""
        self._arm, self._given, self._settings = arm, generator, settings
        self._state, self._result = state, result
        self._caught = settings.caught
        self.begin()

    def begin(self) -> None:
        """Watch for a ball with the generator as it was given."""
        self.generator, self.failure = fresh_for_throw(self._given), ""
        self.brake = np.zeros((1, 3, self._arm.n))
        self._verdict: Verdict | None = None
        self._deferred: tuple[BallState, Array] | None = None
        self._pending: _Inquiry | None = None
        self._doubt: tuple[float, Verdict] | None = None  # first against a ball followed, when [s]
        self.certificate: Verdict | None = None

    @property
    def phase(self) -> int:
        """Phase of the next tick."""
        phase: int = self._scalars["phase"].item()
        return phase

    @property
    def _scalars(self) -> Any:  # noqa: ANN401
        return self._state.scalars[0]

    @property
    def _out(self) -> Any:  # noqa: ANN401
        return self._result.scalars[0]

    @property
    def verdict(self) -> Verdict | None:
        """Verdict on the throw, the newest; None before the first."""
        if self._deferred is None:
            return self._verdict
        try:
            return self._of_rest(*self._deferred)
        except Exception:  # whatever a generator raises: it stops the arm where it is asked in turn
            return self._verdict

    def think(self, todo: int) -> None:
        """Do what a tick has left to be thought about: bits of :mod:`mitt.core.catcher.settings`.

        What fails here ends in a controlled stop in the next tick.
        """
        if todo == 0 or self.phase not in (WATCH, FOLLOW, REFUSED):
            return
        try:
            self._decide(todo)
        except Exception as error:  # whatever a generator or a solver raises
            self._fail(error, FAILED_TICKS)

    def _fail(self, error: Exception, ticks: int) -> None:
        """Keep what failed, and count so many ticks without an answer."""
        root, where = error.__cause__ or error, ""
        place = root.__traceback__
        while place is not None:
            where = f" ({Path(place.tb_frame.f_code.co_filename).name}, line {place.tb_lineno})"
            place = place.tb_next
        said = str(error) if isinstance(error, MittError) else f"{type(error).__name__}: {error}"
        self.failure = " ".join(said.split()) + where
        self._scalars["failures"] += ticks

    def _decide(self, todo: int) -> None:
        """Do what :meth:`think` says."""
        ball = ball_in(self._result)
        if self.phase == REFUSED:  # of the flight that was refused, not of this one
            self._enter(WATCH)
        if self._pending is not None and self._is_vain(self._pending, ball):
            self._ponder(None)
            self._scalars["t_look"] = ball.t
        if self.phase == WATCH:
            self._watch(ball)
        else:
            self._follow(ball, todo)

    def _is_vain(self, p: _Inquiry, ball: BallState) -> bool:
        """Say whether a verdict is of no use any more.

        It was of another flight, or of a ball that was lost meanwhile; or the catch is so near that
        what is followed is left as it is.
        """
        out, near = self._out, self._settings.adapt_until
        soon = bool(out["inside"]) and out["time_to_catch"].item() < near
        late = soon and p.asked in (LAGS, REVIEWS)
        return late or p.begun != self.flight_begun or ball.t - p.ball.t > _STALE

    def _follow(self, ball: BallState, todo: int) -> None:
        """Do what a ball that is followed asks for."""
        before, goes_on = self.generator, self._pending is not None
        if todo & PASSES and self._has_passed(ball):
            if self._pending is None or self._pending.asked != PASSES:
                self._ask(PASSES, ball)
        elif todo & DECIDE:
            self._reconsider(ball)
        elif todo & LAGS and fits(self.generator, Leaving):
            # Its limits, the arm itself or the floor keep it from what it was told.
            self._open()
            said = self._considered(ball, self._state.estimated, Pieces())[0]
            self._give_up(replace(said, outcome=Outcome.UNSETTLED, binding_limit="blocked"))
        elif todo & LAGS:
            # The ball has left the arm behind, as after a bounce: the map starts again from where
            # the arm is and how fast it moves, eq. (12), and the gap is closed on the way to the
            # catch instead of by feedback at once.
            self._renew(ball, lags=True)
        elif todo & REVIEWS:
            self._review(ball, lost=bool(todo & PASSES))
        if todo & GRASPS and self.phase == FOLLOW:
            self._grasp()
        if goes_on:
            adapted = self.generator is not before
            self._go_on(ball, PIECES - (_ADAPTATION if adapted else 0))

    def refer(self) -> None:
        """Evaluate a generator that is no map; where it fails, there is no motion in this tick."""
        if self.phase != FOLLOW:
            return
        ball = ball_in(self._result)
        try:
            ball = self.generator.waiting(ball) if self._scalars["surrogate"] else ball
            answer = self.generator.reference(ball)
            motion = answer.q_d, answer.dq_d, answer.ddq_d, answer.q_o, answer.dq_o
            for row, value in zip(self._result.reference, motion, strict=False):
                row[:] = value
        except Exception as error:  # whatever a generator raises
            self._fail(error, 1)
            return
        out = self._out
        out["inside"] = answer.status is MapStatus.INSIDE
        leaving, left = fits(self.generator, Leaving), answer.time_to_catch
        ahead = out["inside"] and (left >= -PASSED or leaving)  # what it chose may lie far behind
        out["time_to_catch"] = left if ahead else np.inf
        if out["inside"] and left == np.inf and leaving:
            self._scalars["t_ahead"] = -np.inf
            self._open()
        self._answered()

    def _open(self) -> None:
        """Open a hand that was closing."""
        for time in ("t_begun", "t_catch", "duration"):
            self._state.fingers[0][time] = np.inf

    def _enter(self, phase: int) -> None:
        """Begin another phase with the next tick; one that has stopped begins none."""
        if self.phase != STOPPED:
            self._scalars["phase"] = phase
            self._scalars["halted"], self._scalars["t_moved"] = False, np.inf
            self._ponder(None)
            self._answered()

    def _ponder(self, pending: _Inquiry | None) -> None:
        """Begin to work a verdict out, or end it."""
        self._pending, self._scalars["ponders"] = pending, pending is not None

    def _ask(self, asked: int, ball: BallState) -> None:
        """Ask for a verdict on a ball; it is worked out from the next tick on.

        A generator that is asked only after a pause is asked at once, unless it works in pieces: it
        begins with the ball that it judged.
        """
        at_once = fits(self.generator, Paced) and not fits(self.generator, Piecewise)
        self._ponder(
            _Inquiry(
                asked=asked,
                ball=ball,
                begun=self.flight_begun,
                start=self._state.estimated.copy(),
                pieces=Pieces(np.inf if at_once else 0),
            )
        )
        if at_once:
            self._go_on(ball)

    def _answered(self) -> None:
        """Forget ticks without an answer, unless they were enough for a stop."""
        if self._scalars["failures"] < FAILED_TICKS:
            self._scalars["failures"] = 0

    def _watch(self, ball: BallState) -> None:
        """Give the verdict once the ball is known well enough, or when it is due.

        A verdict is for this flight, so it waits until the ball is as near as it has to be for a
        start, and until a ball that has left the images is back in them.
        """
        if self._pending is not None:
            self._go_on(ball)
        elif self._is_due(ball, self.flight_begun):
            self._ask(DECIDE, ball)

    def _is_due(self, ball: BallState, begun: float) -> bool:
        """Say whether it is time for a verdict on a ball whose flight began at a time [s]."""
        t_look, of = self._scalars["t_look"].item(), self._settings
        sigma = 0.0 if ball.t < t_look else self.generator.sharpness(ball)
        if too_early.py_func(ball.t, begun, sigma, t_look, of.watch, of.sigma_ready):
            return False
        if self.generator.unsettled(ball, self._state.estimated[0]):
            # What the verdict says besides is computed when ``verdict`` is read.
            self._deferred = ball, self._state.estimated[0].copy()
            return False
        if self._is_out_of_sight() or self._is_far(ball):
            self._deferred = ball, self._state.estimated[0].copy()
            self._scalars["t_look"] = ball.t + _LOOK_AGAIN
            return False
        return True

    def _go_on(self, ball: BallState, count: int = PIECES) -> None:
        """Go on with the verdict that is asked for, some pieces a millisecond, and act on it.

        Args:
            ball: Estimate of the ball now.
            count: How many pieces.
        """
        if (p := self._pending) is None:
            return
        if p.pieces.left < np.inf:
            p.pieces.grant(count * max(round(self._scalars["passed"].item() / TICK), 1))
        with suppress(Unfinished):
            self._settle(p, ball)

    def _settle(self, p: _Inquiry, ball: BallState) -> None:
        """Act on a verdict once it is known.

        Args:
            p: What was asked.
            ball: Estimate of the ball now.

        Raises:
            Unfinished: It is to be gone on with in the next tick.
        """
        said, g = p.pieces.whole("considered", self._considered, p.ball, p.start, p.pieces)
        if p.asked == PASSES:
            self._let_pass(said, g, ball)
        elif p.asked == REVIEWS:
            self._ponder(None)
            if said.outcome is Outcome.OPEN:
                self._await(said, g, ball)
        else:
            self._act_on(p, self._examined(said, p.pieces), g, ball)

    def _act_on(self, p: _Inquiry, verdict: Verdict, g: Generator, ball: BallState) -> None:
        """Follow a ball by a verdict on it, or brake.

        What is held against a ball rests on the estimate that was judged, not on a newer one.

        Args:
            p: What was asked.
            verdict: The verdict.
            g: The generator that it rests on.
            ball: Estimate of the ball now.
        """
        followed = (Outcome.FEASIBLE,) if self._scalars["surrogate"] else _FOLLOWED
        if verdict.outcome in followed:
            self._take(verdict, g, ball, p.pieces)
        elif self.phase == WATCH:
            self._ponder(None)
            self._decline(verdict, p.ball, p.begun)
        elif p.asked == DECIDE:
            self._ponder(None)
            if said := self._against(verdict, p.ball, verdict.outcome is Outcome.UNREACHABLE):
                self._give_up(said)
            else:
                self._scalars["t_look"] = p.ball.t + _JUDGE_AGAIN
        elif said := self._against(
            verdict, p.ball, harms(self._arm, verdict, self._caught, p.pieces)
        ):
            self._give_up(said)
        else:
            if verdict.approach is not None:  # the verdict stays; it is tried with this motion
                self._make_room(verdict, p.pieces)
                self._verdict = self._verdict and replace(self._verdict, approach=verdict.approach)
            self._ponder(None)
            self._adapt(ball, g)

    def _decline(self, verdict: Verdict, ball: BallState, begun: float) -> None:
        """Keep a verdict with which no ball is followed; refuse a flight for which it is due."""
        self._verdict, self._deferred = verdict, None
        if fits(self.generator, Paced):
            self._scalars["t_look"] = ball.t + self.generator.pause()
        flies = verdict.outcome is Outcome.UNREACHABLE and not ball.led
        if flies and ball.t - begun >= self._settings.watch:
            self._refuse(ball, begun)

    @property
    def flight_begun(self) -> float:
        """When the flight began that the estimate is of [s]: seen first, let go or kicked."""
        t_flight, t_first = self._scalars["t_flight"].item(), self._out["t_first"].item()
        return float(flight_begun.py_func(t_flight, t_first))

    def _refuse(self, ball: BallState, begun: float) -> None:
        """Refuse a flight: until another begins, and for good once this one has passed by."""
        after = np.arange(0.0, HORIZON, STRIDE)
        path, hand = flown(ball, after), self._arm.position(self._state.estimated[0])
        nears = np.einsum("ki,ki->k", path[:, 0] - hand, path[:, 1]) < 0.0
        passes = float(after[nears].max(initial=0.0))
        self._scalars["t_refused"], self._scalars["t_gone"] = begun, ball.t + passes + _LANDS
        judged = (
            self._out["t_ball"].item() - ball.t
        )  # so long ago: from now on it is flown by ticks
        self._state.refused[:] = flown(ball, np.array([max(judged, 0.0)]))[0, :2]
        self._enter(REFUSED)

    def _is_far(self, ball: BallState) -> bool:
        """Say whether there is time for a verdict; one that looks far ahead itself is for now."""
        if fits(self.generator, Farsighted):
            return False
        return is_far(ball, self._arm.position(self._state.estimated[0]))

    def _examined(self, verdict: Verdict, pieces: Pieces) -> Verdict:
        """Return a generator's verdict for the arm as it is and moves, up to its rest afterwards.

        A generator that knows of an arm at rest alone is taken at its word that the ball has
        come back, or was feasible; what comes after the catch is looked at all the same.
        """
        g = self.generator
        if isinstance(g, Unoptimised):  # alpha = 0 is never refused
            return verdict
        if self.phase != WATCH and not fits(g, Underway):
            verdict = replace(verdict, outcome=Outcome.FEASIBLE)
        bandwidth = self._settings.bandwidth
        return examined(self._arm, verdict, self._caught, bandwidth=bandwidth, pieces=pieces)

    def _considered(
        self, ball: BallState, start: Array, pieces: Pieces
    ) -> tuple[Verdict, Generator]:
        """Return what the generator says of a ball, and the generator that this rests on.

        Args:
            ball: Estimate of the ball.
            start: q, dq of the arm, of which it may know alone that it rests, shape (2, n).
            pieces: What is known, and how much may be worked out.
        """
        g, (q, dq), moves = self.generator, start.copy(), self.phase != WATCH
        if fits(g, Piecewise):
            said, chosen = g.consider(ball, q, dq if moves else None, pieces)
            if fits(g, Leaving):
                said = pieces.of("clear", _kept_clear, self._state.safety, said)
            return said, chosen
        if moves and fits(g, Underway):
            return pieces.of("said", g.verdict, ball, q, dq), g
        return pieces.of("said", self._of_rest, ball, q), g

    def _of_rest(self, ball: BallState, q: Array) -> Verdict:
        """Return what the generator says of a ball for an arm that rests in a pose."""
        g, verdict = self.generator, self.generator.verdict(ball, q)
        return _kept_clear(self._state.safety, verdict) if fits(g, Leaving) else verdict

    def _take(self, verdict: Verdict, g: Generator, ball: BallState, pieces: Pieces) -> None:
        """Let a verdict that the ball can be caught, or waited for, take effect: follow it.

        Args:
            verdict: The verdict.
            g: The generator that it rests on: nothing is chosen again.
            ball: Estimate of the ball now.
            pieces: What is known of the verdict.
        """
        self._make_room(verdict, pieces)
        self._verdict, self._deferred, self._doubt = verdict, None, None
        self._scalars["surrogate"] = verdict.outcome is Outcome.OPEN
        self._adapt(ball, g, waits=verdict.outcome is Outcome.OPEN)
        self._enter(FOLLOW)

    def _is_out_of_sight(self) -> bool:
        """Say whether an arm that followed the ball would stop at once: it is not seen any more."""
        age, sigma = self._out["age"].item(), self._scalars["flight_sigma"].item()
        return bool(is_lost(age, sigma, self._settings.tolerance))

    def _make_room(self, verdict: Verdict, pieces: Pieces) -> None:
        """Keep the joints that the ball will drive on below their speed limits by as much.

        The motors' torque is kept to what is left of it at such speeds. Nothing is written before
        all is worked out.
        """
        caps, jumps = speeds_of(self._arm), np.zeros(self._arm.n)
        if verdict.approach is not None:
            given = self._arm, verdict.approach, self._caught, pieces
            caps, jumps = speed_caps(*given), speed_jumps(*given)
        pieces.rest()
        self._state.safety.bounds["dq_max"][:], self._state.jump[:] = caps, jumps

    def _reconsider(self, ball: BallState) -> None:
        """Follow the ball itself as soon as it can be caught; its surrogate target until then.

        The arm brakes where the ball, known well, has come back and cannot be caught.
        """
        if self._pending is not None or ball.t < self._scalars["t_look"]:
            return
        if not self.generator.returns(ball):
            self._doubt = None
            return
        self._ask(DECIDE, ball)

    def _has_passed(self, ball: BallState) -> bool:
        """Say whether a ball comes no more, by where it is and how it moves now.

        What a generator foresees is not asked: of a ball that is pushed about it foresees a catch
        in one moment and none in the next. One that leaves by itself says so for good.
        """
        hand, floor = self._arm.position(self._state.estimated[0]), self._settings.around.floor
        return fits(self.generator, Leaving) or not comes(ball, hand, floor)

    def _let_pass(self, verdict: Verdict, g: Generator, ball: BallState) -> None:
        """Brake for a ball that has passed by; wait for one that a bounce may still bring up."""
        self._ponder(None)
        if verdict.outcome is Outcome.OPEN:
            self._await(verdict, g, ball)
        elif fits(self.generator, Leaving) and verdict.outcome is not Outcome.FEASIBLE:
            self._give_up(verdict)  # what was met says why it was given up
        else:
            self._slow_down(self._arm)

    def _await(self, verdict: Verdict, g: Generator, ball: BallState) -> None:
        """Wait for a ball whose verdict has become open, as it might have been before the start."""
        self._scalars["t_ahead"] = ball.t
        self._take(verdict, g, ball, Pieces())

    def _renew(self, ball: BallState, *, lags: bool) -> None:
        """Let the generator start again from where the arm is, for a ball that is elsewhere.

        What asks for too much on the way is tried all the same, within all limits. But the arm
        brakes where for some time it would not come through the impact, or not hold the ball. A
        verdict takes long: until it is known what is followed starts again at once, and so does
        what lags again soon, and a generator whose verdicts do not depend on its motion.

        Args:
            ball: The ball.
            lags: Whether the arm was left behind.
        """
        blind = self._verdict is None or self._verdict.approach is None
        if not blind and self._pending is None and ball.t >= self._scalars["t_look"]:
            self._scalars["t_look"] = ball.t + _LOOK_AGAIN
            self._ask(LAGS, ball)
        if (lags or blind) and self.phase == FOLLOW:
            self._adapt(ball, self.generator)

    def _against(self, verdict: Verdict, ball: BallState, against: bool) -> Verdict | None:
        """Return the verdict by which the arm is to brake: one near its catch, or that has lasted.

        Of verdicts that are against a ball for some time that is the first, which says why.

        Args:
            verdict: On a ball that is followed or waited for.
            ball: That ball.
            against: Whether the verdict is that it is not to be caught.
        """
        if not (against and self._is_sharp(ball)):
            self._doubt = None
            return None
        t, first = self._doubt = self._doubt or (ball.t, verdict)
        lasted = ball.t - t >= PATIENCE or verdict.t_catch - ball.t < SOON
        return first if lasted else None

    def _is_sharp(self, ball: BallState) -> bool:
        """Say whether a ball is known well enough at its catch to be refused."""
        return self.generator.sharpness(ball) <= self._settings.sigma_ready

    def _give_up(self, verdict: Verdict) -> None:
        """Brake from the last command on: the ball that was followed is refused."""
        self._ponder(None)
        self._verdict, self._deferred = verdict, None
        self._slow_down(self._arm)

    def _adapt(self, ball: BallState, g: Generator, *, waits: bool = False) -> None:
        """Let a generator start from where the arm is, for a ball or to wait for it."""
        q, dq = self._state.estimated.copy()
        if waits and fits(g, Underway):
            self.generator = g.wait(ball, q, dq)
        else:
            self.generator = g.adapt(g.waiting(ball) if waits else ball, q, dq)
        if fits(self.generator, Underway):
            self.certificate = self.generator.certificate
        f = self.generator.as_map()
        if f is not None:
            overwrite(self._state.map, f.arrays)
            self._scalars["waiting_height"] = waiting_height(f)

    def _review(self, ball: BallState, *, lost: bool) -> None:
        """Follow another map where the present one cannot catch any more what it could at first.

        A verdict against the ball is given again until it has lasted, or is another. What was to be
        caught on the very edge of the reach may turn out to pass below it, and is waited for.

        Args:
            ball: The ball that is followed.
            lost: Whether no catch was ahead for some time.
        """
        hoped = self.verdict is not None and self.verdict.outcome is Outcome.FEASIBLE
        astray = hoped and fits(self.generator, Underway) and self.generator.astray(ball)
        if astray or self._doubt is not None:
            self._renew(ball, lags=False)
        elif lost and self._pending is None:
            self._ask(REVIEWS, ball)

    def move(self, motion: Array, t: float) -> None:
        """Follow a motion from now on, as if it were that of the brake; see ``Catcher.move``."""
        self.brake = motion.copy()
        self.brake[-1, 1:] = 0.0
        self._brake_from(t)

    def _grasp(self) -> None:
        """Brake from the last command on, or go away with the ball: the fingers will have closed.

        The model carries the ball's weight from then on.
        """
        loaded = self._arm.holding(self._settings.ball_mass)
        self._slow_down(loaded)
        exchange_arm(self._state, loaded)

    def _slow_down(self, arm: Arm) -> None:
        """Bring an arm, with the ball or without, to rest from the last command on.

        As its generator leaves, where it says so: an arm that brakes joint by joint may sink.
        """
        t, g = self._result.scalars["t"].item(), self.generator
        last = self._result.command[:3].copy()
        way = g.leaving(last) if fits(g, Leaving) else None
        if way is None:
            self.brake = plan_brake(arm, t, last).table(TICK)
            self._brake_from(t)
        else:
            self.move(way, t)

    def _brake_from(self, t: float) -> None:
        """Follow the brake from a time on [s]."""
        self._scalars["t_brake"], self._scalars["t_rest"] = t, t + len(self.brake) * TICK
        self._enter(BRAKE)


def _kept_clear(s: Safety, verdict: Verdict) -> Verdict:
    """Refuse, as ``clearance``, a way on which the safety filter would stop the arm."""
    if verdict.outcome is not Outcome.FEASIBLE or verdict.approach is None:
        return verdict
    poses = verdict.approach.motion[:, 0]
    if min(clearance(s.arm.bodies, q, s.shapes, s.pairs, s.ends) for q in poses) >= STOP_CLEARANCE:
        return verdict
    return replace(verdict, outcome=Outcome.UNSETTLED, binding_limit="clearance", share=np.inf)
