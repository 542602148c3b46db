"""Why a ball was missed: what a replay shows, and its first cause in plain words."""

import json
from collections.abc import Iterator
from dataclasses import dataclass
from itertools import pairwise
from typing import Any

import numpy as np

from mitt.core.arm.arm import Arm
from mitt.core.catcher.settings import FOLLOW, PHASES, REFUSED, WATCH, CatcherSettings
from mitt.core.control.health import State
from mitt.core.signals import Array
from mitt.core.verdict.feasibility import Outcome
from mitt.io.messages import EVENT, TRUTH
from mitt.lab.trials.log import FIRST_CONTACT, catch_tick
from mitt.lab.trials.replayed import Judged, Replayed
from mitt.lab.trials.score import drive_loads
from mitt.lab.trials.tasks import TASKS

#: What a hand needs: 1-sigma of the ball's place, and how far it may be off [m].
_NEAR = CatcherSettings().tolerance
#: Age of the last measurement that a catch survives [s], a choice of this project.
_OLD = 0.1
_STATES = tuple(State)
_CONTACT = (EVENT, FIRST_CONTACT)
#: What a limit that binds means, by its kind.
LIMITS = {
    "torque": "{0} would need more torque than it has",
    "speed": "{0} would have to be faster than it may",
    "acceleration": "{0} would have to speed up more than it may",
    "range": "the range of {0} ends",
    "brake": "{0} would have too little room to come to rest after the catch",
    "impact": "the impact would drive {0} beyond its speed",
    "force": "the ball would press on the hand harder than hand or arm take",
    "hand": "the fingers would have too little time to close",
    "grip": "the fingers would not hold the ball",
    "seal": "the cup would not hold the part",
    "palm": "the ball would come from behind the palm and touch the fingers first",
    "spill": "the ball would leave the basket in the brake",
    "optimum": "the oracle found no motion within the limits",
    "domain": "the ball flies outside the domain of the map",
    "region": "the catch would be outside the region that the map was learned for",
    "clearance": "the arm would come too near to itself, the floor or a zone",
    "blocked": "the arm would be kept from following",
    "jerk": "the acceleration of {0} would have to change faster than it may",
    "torque_rate": "the torque of {0} would have to change faster than it may",
    "tool": "the tool would have to be faster than it may",
    "area": "the part is not in the work area when it would be met",
    "window": "the part leaves the work area before the tool would have closed",
    "hidden": "the part was hidden until its place was not known well enough",
    "taken": "the part fell, left its belt or was taken away",
}


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class Evidence:
    """What a replay of k ticks shows, a row a tick; NaN where a tick has no such thing.

    Attributes:
        t: Time of the tick [s], shape (k,).
        residual: Distance of a sighting from where the tick before expected it [m], shape (k,).
        error: Distance of the estimate from the truth until hand and ball touch, where the
            recording has it [m], shape (k,).
        sigma: 1-sigma of the ball's estimated place [m], shape (k,).
        age: Age of the last good measurement [s], shape (k,).
        torque: Share of each joint's torque limit that was commanded, shape (k, n).
        speed: The same of its speed limit, shape (k, n).
        behind: Distance of the commanded catch point from the desired one, and of the measured one
            from the commanded one [m], shape (k, 2).
        catch: Tick of the catch by the map; None where it came to none.
    """

    t: Array
    residual: Array
    error: Array
    sigma: Array
    age: Array
    torque: Array
    speed: Array
    behind: Array
    catch: int | None

    @property
    def last_error(self) -> float:
        """The last known error up to the catch [m]; NaN without one."""
        until = self.error[: 0 if self.catch is None else self.catch + 1]
        known = until[np.isfinite(until)]
        return float(known[-1]) if len(known) else np.nan

    @property
    def shown(self) -> tuple[float, float]:
        """From when to when something is to be seen [s]: to 350 ticks after the last sighting."""
        known = np.flatnonzero(np.isfinite(self.sigma) | np.isfinite(self.residual))
        last = self.t[min(known[-1] + 350, len(self.t) - 1)] if len(known) else self.t[-1]
        return float(self.t[0]), max(float(last), float(self.t[0]) + 1e-3)


@dataclass(frozen=True, slots=True, kw_only=True)
class Explanation:
    """What came of a throw and why.

    Attributes:
        status: Status of the trial; ``unknown`` where the recording does not say.
        cause: Its first cause, a sentence.
        facts: What else is worth knowing: name and value.
    """

    status: str
    cause: str
    facts: tuple[tuple[str, str], ...]


def _place(arm: Arm, q: Array) -> Array:
    """Return where the hand is [m], shape (3,); NaN where a joint was not read."""
    return arm.position(q) if np.isfinite(q).all() else np.full(3, np.nan)


def evidence_of(x: Replayed) -> Evidence:
    """Return what a replay shows."""
    s, arm, command = x.ticks.scalars, x.about.driven_arm, x.ticks.command
    tracked, following = s["tracked"] & np.isin(s["phase"], (WATCH, FOLLOW)), s["following"]
    q, q_d = command[:, 0], x.ticks.reference[:, 0]
    places = [
        np.array([_place(arm, row) for row in rows]).reshape(-1, 3)
        for rows in (q, q_d, x.ticks.encoders[:, 0])
    ]
    behind = np.linalg.norm([places[1] - places[0], places[2] - places[0]], axis=2).T
    behind[~following] = np.nan
    read = np.nan_to_num(x.ticks.encoders)
    loads = drive_loads(arm, read[:, 0].copy(), read[:, 1].copy(), command[:, 3].copy())
    return Evidence(
        t=s["t"],
        residual=_residuals(x),
        error=np.where(tracked & (s["t"] < _touched(x)), _errors(x), np.nan),
        sigma=np.where(tracked, s["sigma"], np.nan),
        age=np.where(tracked, s["age"], np.nan),
        torque=arm.by_joint(loads.share) if len(s) else np.zeros((0, arm.n)),
        speed=np.abs(command[:, 1]) / arm.dq_max,
        behind=behind,
        catch=catch_tick(x.ticks),
    )


def _touched(x: Replayed) -> float:
    """Return when hand and ball first touched [s]; infinite where the recording does not say."""
    contacts = (t for t, topic, text in x.recorded.notices if (topic, text) == _CONTACT)
    return min(contacts, default=np.inf)


def _residuals(x: Replayed) -> Array:
    """Return how far each sighting was from where the tick before expected it [m]."""
    s, ball = x.ticks.scalars, x.ticks.ball
    out = np.full(len(s), np.nan)
    rows = x.recorded.ticks
    for k, number in enumerate(x.recorded.numbers.tolist()[: len(s)]):
        seen = [(p.t, p.r_o) for p in x.recorded.points(number) if p.found]
        if not seen and rows["out_sighted"][k]:
            seen = [(float(rows["out_t_sighted"][k]), rows["sighting"][k, :3])]
        if k and s["tracked"][k - 1] and s["phase"][k] in (WATCH, FOLLOW):
            for t, r in seen:
                expected = ball[k - 1, 0] + (t - s["t_ball"][k - 1]) * ball[k - 1, 1]
                out[k] = np.linalg.norm(r - expected)
    return out


def _errors(x: Replayed) -> Array:
    """Return how far the estimate is from the truth [m]; NaN where nobody knows it."""
    t, r = x.recorded.track(TRUTH)
    at = x.ticks.scalars["t_ball"]
    if len(t) < 2 or not np.all(np.diff(t) > 0.0):
        return np.full(len(at), np.nan)
    true = np.stack([np.interp(at, t, r[:, i], left=np.nan, right=np.nan) for i in range(3)])
    distance: Array = np.linalg.norm(x.ticks.ball[:, 0] - true.T, axis=1)
    return distance


def explain(x: Replayed, e: Evidence) -> Explanation:
    """Return what came of a throw and why; of several causes the one that came first."""
    status = _status(x)
    if np.any(x.differs):
        k = int(np.argmax(x.differs))
        cause = (
            f"From {_ms(e.t[k])} on this replay commands something else. The arm moved as"
            " recorded, so what comes later says nothing of a catch."
        )
    else:
        done = {of.scored.success: of.scored.done for of in TASKS.values()}
        cause = done.get(status) or next(_causes(x, e))
    return Explanation(status=status, cause=cause, facts=tuple(_facts(x, e)))


def _causes(x: Replayed, e: Evidence) -> Iterator[str]:
    """Yield what went wrong, the first cause first."""
    s, stop = x.ticks.scalars, x.stopped_by
    if not np.any(s["tracked"]):
        seen = int(np.sum(np.isfinite(e.residual)) + np.sum(s["sighted"]))
        yield f"The ball was never tracked: {seen} sightings came, too few for a track to begin."
    if stop is not None:
        joint = f" of {stop.joint}" if stop.joint else ""
        yield f"The catcher stopped at {_ms(stop.t)}: {stop.reason.value}{joint}."
    last = x.verdicts[-1] if x.verdicts else None
    if REFUSED in s["phase"] and last is not None:
        yield f"Refused before the arm moved: {limit_words(last)}."
    if FOLLOW not in s["phase"]:
        best = float(np.nanmin(e.sigma, initial=np.inf))
        said = "no verdict was reached" if last is None else f"the verdict was {_said(last)}"
        yield f"The arm never started: {said}; the ball was known to {1e3 * best:.0f} mm at best."
    if e.catch is None:
        yield (
            "The arm started, but no catch came: the ball left the domain of the map, or the"
            " recording ends before."
        )
        return
    yield from _at_the_catch(x, e, e.catch)


def _at_the_catch(x: Replayed, e: Evidence, k: int) -> Iterator[str]:
    """Yield what was wrong in the tick of the catch."""
    held, lag = e.behind[k]
    if e.last_error > _NEAR:
        yield (
            f"The estimate was wrong: {1e3 * e.last_error:.0f} mm from the ball when it should"
            " have met the hand."
        )
    if e.age[k] > _OLD:
        yield f"The ball had not been seen for {1e3 * e.age[k]:.0f} ms at the catch."
    if held > _NEAR:
        ticks = int(np.sum(x.ticks.scalars["saturated"]))
        yield (
            f"Limits held the arm back: at the catch its command was {1e3 * held:.0f} mm behind"
            f" the map; a torque limit was met in {ticks} ticks."
        )
    if lag > _NEAR:
        yield f"The arm did not follow its commands: {1e3 * lag:.0f} mm off at the catch."
    hand = x.about.driven_arm.model.hand
    closes = hand is not None and hand.closes
    closing = np.flatnonzero(x.ticks.scalars["hand"] > 0.0)
    if closes and (not len(closing) or closing[0] > k):
        yield "The fingers began to close after the catch, too late."
    timing = " the timing of the fingers" if closes else " the speed of the ball in the basket"
    yield (
        "By what the catcher knew, hand and ball met: command, arm and estimate agreed within"
        f" {1e3 * np.nanmax([held, lag]):.0f} mm. Look at the contact,{timing}"
        " or the calibration."
    )


def _facts(x: Replayed, e: Evidence) -> Iterator[tuple[str, str]]:
    """Yield what else is worth knowing."""
    s = x.ticks.scalars
    first = np.flatnonzero(s["tracked"])
    yield "ticks", str(len(s))
    if len(first):
        yield "first tracked", _ms(e.t[first[0]])
    if np.isfinite(x.t_0):
        yield "arm started", _ms(x.t_0)
    for judged in x.verdicts[-1:]:
        yield "verdict", f"{_said(judged)} at {_ms(judged.t)}"
    if e.catch is not None:
        yield "catch by the map", _ms(e.t[e.catch])
        for name, value in (
            ("last error", e.last_error),
            ("1-sigma at the catch", e.sigma[e.catch]),
        ):
            if np.isfinite(value):
                yield f"estimate, {name}", f"{1e3 * value:.1f} mm"
    if np.any(np.isfinite(e.residual)):
        yield "residuals, median", f"{1e3 * np.nanmedian(e.residual):.2f} mm"
        yield "residuals, largest", f"{1e3 * np.nanmax(e.residual):.1f} mm"
    if len(s):
        yield (
            "largest share of torque, speed",
            " / ".join(f"{100 * np.max(share):.0f} %" for share in (e.torque, e.speed)),
        )
    if x.recorded.dropped:
        yield "ticks that the recorder dropped", str(x.recorded.dropped)


def spans(values: Array, t: Array, names: tuple[str, ...]) -> list[tuple[str, float, float]]:
    """Return in which spans of time a number had which name: name, from, to [s]."""
    if not len(values):
        return []
    edges = [0, *(np.flatnonzero(np.diff(values)) + 1).tolist(), len(values) - 1]
    return [
        (names[int(values[a])], float(t[a]), float(t[b]))
        for a, b in pairwise(edges)
        if b > a or len(values) == 1
    ]


def timeline(x: Replayed) -> dict[str, list[tuple[str, float, float]]]:
    """Return phases and states in their spans of time."""
    s = x.ticks.scalars
    return {
        "phase": spans(s["phase"], s["t"], tuple(p.value for p in PHASES)),
        "state": spans(s["health"], s["t"], tuple(p.value for p in _STATES)),
    }


def limit_words(judged: Judged) -> str:
    """Return what the limit of a verdict means, in words."""
    return words_of_limit(judged.verdict.binding_limit or "unknown")


def words_of_limit(limit: str) -> str:
    """Return what a limit means, in words, with its name behind: ``brake:j4``."""
    kind, _, joint = limit.partition(":")
    return f"{LIMITS[kind].format(joint or 'a joint')} ({limit})" if kind in LIMITS else limit


def _said(judged: Judged) -> str:
    """Return a verdict in words."""
    verdict = judged.verdict
    limit = f", {verdict.binding_limit} asked most" if verdict.binding_limit else ""
    if limit and verdict.outcome not in (Outcome.FEASIBLE, Outcome.OPEN):
        limit = f", {limit_words(judged)}"
    word = {Outcome.OPEN: "open: the ball was waited for"}.get(
        verdict.outcome, verdict.outcome.value
    )
    return f"{word}{limit}"


def _status(x: Replayed) -> str:
    """Return the status that the recording states; ``stopped`` or ``unknown`` without."""
    try:
        trial: Any = json.loads(x.recorded.notes.get("trial", "{}"))
        found = trial.get("status") if isinstance(trial, dict) else None
    except (ValueError, RecursionError):
        found = None
    return str(found)[:40] if found else "unknown" if x.stopped_by is None else "stopped"


def _ms(t: float) -> str:
    """Return a time."""
    return f"{t:.3f} s"
