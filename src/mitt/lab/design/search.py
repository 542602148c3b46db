"""The search for a design: geometry, verdicts, throws, and small changes by both of these.

The last throws, which choose and report, are seen in images as those of ``mitt catch``; the many
before them as points.

What catches most is rarely what catches most softly. So a search keeps several designs, each the
best for another price of a hard catch (:data:`PRICES`), and chooses at the end: of those that catch
as many as are asked for, the softest.

Every number of candidates is fixed, so that the same seed gives the same design with any number
of workers.
"""

from collections.abc import Sequence
from dataclasses import dataclass, replace
from itertools import cycle
from math import sqrt
from typing import final

import numpy as np
from numpy.typing import NDArray

from mitt.clock import Progress
from mitt.core.arm.arm import Arm
from mitt.core.errors import ModelError
from mitt.io.schema import to_plain
from mitt.lab.design.candidate import Candidate, mutated
from mitt.lab.design.evaluation import Evaluation, How
from mitt.lab.design.geometry import (
    CandidateRows,
    best_of,
    candidates_of,
    drawn,
    improved,
    joined,
    score_candidates,
    triples_of,
)
from mitt.lab.design.poses import Touch
from mitt.lab.design.search_jobs import Answers, Asked, Evaluator, Procedure, digest, plain_task
from mitt.lab.design.task import REPORTED, DesignTask

#: Seeds of the throws by which candidates are compared, and by which the best is chosen; all of
#: a search lie below those of the throws that are reported (:data:`REPORTED`).
_COMPARE = 100
_CONFIRM = 1000
_AGAIN = 1500
#: Stages of small changes; each draws its own.
_BY_THROWS = 2
_BY_VERDICTS = 3
#: What a catch that is harder by 1 m/s costs, in shares of throws; the best for each are kept.
PRICES = (0.005, 0.1, 0.03, 0.2)
#: How often the speed of the fastest throws is bisected.
NEARER = 3
#: In how many parts candidates by geometry are tried on paper, in their order: no more of them once
#: there are enough to learn.
_PARTS = 6
#: How many of the last are thrown at further side by side.
_PAIR = 2
#: Share of the throws that is asked for, if nothing else is said.
RATE = 0.98


@dataclass(frozen=True, slots=True, kw_only=True)
class Effort:
    """How much is looked at in each stage.

    Attributes:
        poses: Poses drawn at a time.
        rounds: Most times that they are drawn.
        enough: Candidates by geometry after which no more are drawn.
        changes: Rounds of small changes of these.
        judged: Candidates that are learned and judged by verdicts.
        generations: Rounds of small changes that are judged by verdicts alone.
        offspring: Changed ones of each of these.
        thrown: Those of them that are thrown at.
        throws: Throws at each in each generation, the first being that without changes. They grow,
            so that the few that are left are told apart; where there are more than at first, maps
            are learned from as many flights as those of ``mitt catch``.
        parents: Candidates that are changed in each generation.
        children: Changed ones of each generation.
        last: Candidates that are learned in full and confirmed, with some match weights each.
        confirm: Throws at each of these, by which the best is chosen.
        again: How many of them are thrown at further: the best of several was lucky as well. Two by
            two, the softest first, until one catches as many as are asked for.
        more: Further throws at each of them.
        report: Fresh throws at the chosen one, which alone are reported.
        speeds: Speeds of throws of which the page tells, rising [m/s].
        each_speed: Throws at each of these.
        sure: Fresh throws at the fastest of them that is caught.
        grid: Points of the region of balls on each side of its middle.
        slower: Searches for slower throws where the default ones are not caught.
        size: Size of the first small changes, as :func:`mitt.lab.design.candidate.mutated` takes
            it; less than 1 where they are to stay near.
        weights: Times their match weight with which the last candidates are tried: small changes
            come to soft catches slowly, and one number decides how soft a learned map is.
        images: Whether all throws are seen in images, and not the last alone.
    """

    poses: int = 40_000
    rounds: int = 5
    enough: int = 2000
    changes: int = 16
    judged: int = 60
    generations: int = 8
    offspring: int = 60
    thrown: int = 16
    throws: tuple[int, ...] = (12, 12, 16, 24, 32)
    parents: int = 6
    children: int = 16
    last: int = 5
    confirm: int = 25
    again: int = 4
    more: int = 200
    report: int = 100
    speeds: tuple[float, ...] = (3.0, 4.0, 5.0, 6.0, 7.0, 8.0, 9.0)
    each_speed: int = 12
    sure: int = 50
    grid: int = 8
    slower: int = 3
    size: float = 1.0
    weights: tuple[float, ...] = (1.0, 2.0, 4.0)
    images: bool = False

    def less(self) -> "Effort":
        """Return less of it, for one of several searches."""
        return replace(
            self,
            judged=self.judged // 3,
            generations=self.generations // 2,
            thrown=self.thrown // 2,
            throws=self.throws[:3],
            last=1,
            confirm=self.throws[0],
            more=4 * self.throws[0],
        )

    def halved(self) -> "Effort":
        """Return it with half as many candidates, for an arm with one set of three joints.

        Rounds of small changes by verdicts are two thirds, those by throws two less.
        """
        return replace(
            self,
            judged=(self.judged + 1) // 2,
            generations=(2 * self.generations + 2) // 3,
            offspring=(self.offspring + 1) // 2,
            thrown=(self.thrown + 1) // 2,
            throws=self.throws[:-2],
            parents=(self.parents + 1) // 2,
            children=(self.children + 1) // 2,
            last=self.last // 2,
            again=self.again // 2,
        )


#: By name: what ``mitt design --effort`` may ask for.
EFFORTS = {
    "quick": Effort(
        rounds=2,
        changes=8,
        judged=16,
        generations=4,
        offspring=40,
        thrown=6,
        throws=(12, 12),
        children=8,
        last=1,
        confirm=20,
        more=80,
    ),
    "full": Effort(),
    "refine": Effort(
        rounds=0,
        changes=0,
        judged=0,
        generations=2,
        offspring=24,
        thrown=8,
        throws=(16, 24, 32),
        parents=3,
        children=10,
        last=3,
        confirm=40,
        again=2,
        more=160,
        size=0.4,
        weights=(1.0,),
        images=True,
    ),
}


def effort_of(name: str, joints: int) -> Effort:
    """Return how much is looked at.

    Args:
        name: One of :data:`EFFORTS`.
        joints: How many joints may move. In full, half as many candidates do where there are three.
            After all rounds by throws the match weight has been found: where there are four, the
            last are tried with their own. From five on each takes longer, and one round less is
            made.
    """
    effort = EFFORTS[name]
    if name != "full":
        return effort
    if joints == 3:
        return effort.halved()
    if joints == 4:
        return replace(effort, weights=effort.weights[:1])
    return replace(effort, throws=effort.throws[:-1])


#: What learning a map takes, about, by how it is learned, in the time of one throw. Measured in
#: quick searches for two arms of seven axes (0.19 s of processor time a throw), as the others.
_LEARNED = {"glance": 3.6, "quick": 5.8, "many": 14.5, "full": 22.0}
#: A throw that is seen in images.
_SEEN = 2.6
#: A round of poses, one of small changes of them, and a candidate on paper. The rounds take half or
#: twice as long as for most arms where few or many poses meet the ball.
_DRAWN = 18.0
_CHANGED = 3.0
_TRIED = 0.3


def stages(effort: Effort) -> dict[str, float]:
    """Return what each stage of a search takes, by its name, in the time of one throw."""
    of = {
        "geometry": _DRAWN * effort.rounds,
        "geometry, changed": _CHANGED * effort.changes,
    }
    for k in range(_PARTS):
        of[part_of("on paper", k, _PARTS)] = _TRIED * effort.judged
    of["learning"] = _LEARNED["glance"] * 2 * effort.judged
    for k in range(effort.generations):
        each = _LEARNED["glance"] * effort.offspring
        of[part_of("changing", k, effort.generations)] = each
    seen = _SEEN if effort.images else 1.0
    of["throwing"] = effort.thrown * (_LEARNED["quick"] + seen * effort.throws[0])
    for k, throws in enumerate(effort.throws[1:]):
        each = _LEARNED["quick" if throws == effort.throws[0] else "many"] + seen * throws
        parts = len(effort.throws) - 1
        if throws > effort.throws[k]:
            of[part_of("comparing", k, parts)] = each * effort.parents
        of[part_of("improving", k, parts)] = each * effort.children
    full = _LEARNED["full"]
    of["confirming"] = len(effort.weights) * effort.last * (full + _SEEN * effort.confirm)
    pairs = _pairs(effort.again)
    for k in range(pairs):
        each = effort.again / pairs * (full + _SEEN * effort.more)
        of[part_of("confirming again", k, pairs)] = each
    return of


def part_of(stage: str, k: int, of: int) -> str:
    """Return the name of one of the parts of a stage, from 0."""
    return f"{stage} {k + 1} of {of}"


def _pairs(count: int) -> int:
    """Return in how many steps so many candidates are thrown at two by two."""
    return -(-count // _PAIR)


def last_stages(effort: Effort, *, slower: bool = False) -> dict[str, float]:
    """Return what is done with a design once it is found, in the time of one throw.

    One for slower throws is thrown at in several speeds once it is reported, others meanwhile.
    """
    full, each = _LEARNED["full"], _LEARNED["quick"] + _SEEN * effort.each_speed
    speeds = len(effort.speeds) * each
    nearer = {part_of("nearer", k, NEARER): each for k in range(NEARER)}
    return {
        "reporting": full + _SEEN * effort.report + (0.0 if slower else speeds),
        "speeds": speeds if slower else 0.0,
        "region": full + 4.0 * (2 * effort.grid + 1),
        **nearer,
        "fastest": _LEARNED["quick"] + _SEEN * effort.sure,
    }


def slower_stages(effort: Effort) -> dict[str, float]:
    """Return what each stage of a search for slower throws takes, in the time of one throw."""
    return stages(effort) | {"accepting": _LEARNED["full"] + _SEEN * effort.report}


@final
class SearchProgress:
    """Tells the progress of a whole search whenever it is told that of a stage.

    And the best that is found so far: of those that catch enough the one to take, or else what
    catches most. What is done is what took time: a stage that is left out, or whose answers were
    known, is taken off the whole.
    """

    def __init__(
        self, effort: Effort, progress: Progress, answers: Answers, rate: float = RATE
    ) -> None:
        """Expect one search, and what follows it; what is found is in its answers."""
        self._answers, self._rate = answers, rate
        self._takes, self._last = stages(effort), last_stages(effort)
        self._progress, self._done, self._further, self._searches = progress, 0.0, 0, 0
        self._stage, self._share = "", 0.0

    def again(self, effort: Effort) -> None:
        """Expect searches for slower throws besides, since one has found nothing."""
        self._takes, self._last = slower_stages(effort), last_stages(effort, slower=True)
        self._searches = effort.slower
        self._further, self._stage, self._share = effort.slower, "", 0.0

    def __call__(self, name: str, done: int, of: int) -> None:
        """Take in how much of a stage is done; what its first report says was known before."""
        order = [*self._takes, *self._last]
        if name not in order or of == 0:
            return
        at, before = order.index(name), order.index(self._stage) if self._stage else len(order)
        begins = name in self._takes and (at < before or (name == self._stage and done == 0))
        if begins and self._further > 0:  # the next search
            self._further -= 1
        if name in self._last:
            self._further = 0
        takes, share = self._takes | self._last, done / of
        if name == self._stage and share > self._share:
            self._done += takes[name] * (share - self._share)
        self._stage, self._share = name, share
        left = takes[name] * (1.0 - share) + sum(takes[x] for x in order[at + 1 :])
        whole = self._done + left + self._further * sum(self._takes.values())
        told = f"designing: {self._which()}{name}{self._so_far()}"
        self._progress(told, round(self._done), max(round(whole), 1))

    def _which(self) -> str:
        """Return in words which of the searches for slower throws is under way, if one is."""
        if not self._searches or self._stage in self._last:
            return ""
        return f"slower throws {self._searches - self._further} of {self._searches}, "

    def _so_far(self) -> str:
        """Return in words the best that is found so far."""
        best = self._answers.best
        found = self._answers.most if best is None else ranked(best[1], self._rate)[0]
        return "" if found is None else f" ({found})"


def search(
    evaluator: Evaluator,
    effort: Effort,
    *,
    joints: Sequence[str] | None = None,
    rate: float = RATE,
    start: Candidate | None = None,
) -> list[Evaluation]:
    """Search for ways to catch; the one to take comes first, and there may be none.

    There is none where no candidate has caught a ball within every limit when the best have been
    changed by throws.

    Their throws are those by which they were chosen: the best of several on the same throws, so no
    fair figures (:func:`reported`).

    Args:
        evaluator: The arm, what is to be caught, and where candidates are evaluated.
        effort: How much is tried.
        joints: Joints of which three are active; any if left out.
        rate: Share of the throws that is asked for.
        start: What is changed a little, and returned where nothing better is found; sought by
            geometry if left out.

    Raises:
        ModelError: The arm has too few joints.
    """
    sound = _sought(evaluator, effort, joints) if start is None else [start]
    worth = evaluator.try_all("learning", sound, Procedure(how="glance"))
    worth = _softened(evaluator, effort, worth)
    if start is None:
        best = _distinct(worth, effort.thrown)
    else:
        best = [w.candidate for w in best_by_price(worth, effort.thrown)]
        best = [start, *(c for c in best if c is not start)]
    by = Procedure(throws=effort.throws[0], seed=_COMPARE + effort.throws[0], images=effort.images)
    pool = evaluator.try_all("throwing", best, by)
    pool = _refined(evaluator, effort, pool)
    if not any(w.clean for w in pool):
        return []  # further throws at what caught none would find none
    last = [w.candidate for w in best_by_price(pool, effort.last)]
    if start is not None and start not in last:
        last.append(start)
    return _confirmed(evaluator, effort, last, rate)


def _sought(evaluator: Evaluator, effort: Effort, joints: Sequence[str] | None) -> list[Candidate]:
    """Return candidates by geometry that are sound on paper."""
    whole, task = evaluator.whole, evaluator.task
    triples = triples_of(whole, joints)
    if len(triples) == 0:
        raise ModelError("joints", "at least three, one of which turns", f"{whole.n}")
    rng = np.random.default_rng([task.seed, 1])
    rows = _by_geometry(evaluator, effort, triples, rng)
    if len(rows.q) == 0:
        return []
    first = best_of(rows, count=_PARTS * effort.judged, each=2 * effort.judged)
    candidates, sound = candidates_of(whole, task.balls, first, rng), list[Candidate]()
    for k in range(_PARTS):
        if len(sound) < 2 * effort.judged:
            part = candidates[k * effort.judged : (k + 1) * effort.judged]
            worth = evaluator.try_all(part_of("on paper", k, _PARTS), part, Procedure(how="paper"))
            sound += [w.candidate for w in worth]
    return sound[: 2 * effort.judged]


def search_of(
    whole: Arm,
    task: DesignTask,
    effort: Effort,
    *,
    joints: Sequence[str] | None,
    rate: float,
    start: Candidate | None = None,
) -> str:
    """Return all that decides a search, as a digest."""
    arm = to_plain((whole.model, whole.limits))
    return digest(arm, plain_task(task), to_plain(effort), joints, rate, to_plain(start))


def _confirmed(
    evaluator: Evaluator, effort: Effort, last: Sequence[Candidate], rate: float
) -> list[Evaluation]:
    """Return the last candidates, thrown at with their full maps, the one to take first."""
    softer = [
        replace(c, match_weight=x * c.match_weight)
        for c in last
        for x in (effort.weights if c.match_weight > 0.0 else effort.weights[:1])
    ]
    by = Procedure(throws=effort.confirm, seed=_CONFIRM, how="full", images=True)
    once = evaluator.try_all("confirming", softer, by)
    best, pairs = _likely(once, rate, effort.again), _pairs(effort.again)
    asked = surely(rate, effort.confirm + effort.more)
    by = Procedure(throws=effort.more, seed=_AGAIN, how="full", give_up=False, images=True)
    both = list[Evaluation]()
    for k in range(pairs):
        pair, name = best[_PAIR * k : _PAIR * (k + 1)], part_of("confirming again", k, pairs)
        if not any(w.within >= asked for w in both):
            again = evaluator.try_all(name, [w.candidate for w in pair], by)
            before = {w.candidate: w for w in pair}
            both += [before[w.candidate].with_more(w) for w in again]
    return ranked(both, asked)


def _likely(once: Sequence[Evaluation], rate: float, count: int) -> list[Evaluation]:
    """Return a few that may catch as many as asked for: the softest, and what catches most."""
    soft = ranked(once, rate)
    best = soft[:count]
    surest = max(once, key=lambda w: (w.within, -w.hardness), default=None)
    if surest is not None and surest not in best:
        best[-1] = surest
    return best


def surely(rate: float, throws: int) -> float:
    """Return the share to ask for in so many throws: by one standard error more than the rate.

    The softest of several that caught as many as asked for was lucky; on fresh throws it catches
    less.
    """
    return min(rate + sqrt(rate * (1.0 - rate) / throws), 1.0)


def reported(evaluator: Evaluator, c: Candidate, effort: Effort) -> Evaluation | None:
    """Return what a candidate is worth by throws that no search has used; these are reported.

    None where it is not thrown at.
    """
    worth = evaluator.try_each("reporting", [to_report(c, evaluator.task, effort)])
    return None if worth[0].failed else worth[0]


def to_report(c: Candidate, task: DesignTask, effort: Effort) -> Asked:
    """Return what is asked of a candidate whose throws are reported."""
    own = task.unseen or len(task.throws or task.recordings)  # 0 where throws are drawn
    throws = min(effort.report, own) if own else effort.report
    return c, task, Procedure(throws=throws, seed=REPORTED, how="full", give_up=False, images=True)


def _by_geometry(
    evaluator: Evaluator, effort: Effort, triples: NDArray[np.int64], rng: np.random.Generator
) -> CandidateRows:
    """Return candidates that meet balls all over the box, by geometry alone."""
    whole, balls, progress = evaluator.whole, evaluator.task.balls, evaluator.progress
    found, count, touch = [], 0, Touch(whole, evaluator.task.scene)
    progress("geometry", 0, effort.rounds)
    for k in range(effort.rounds):
        rows = drawn(whole, balls, triples, rng, count=effort.poses, touch=touch)
        found.append(score_candidates(whole, balls, best_of(rows, count=4000, each=400), touch))
        count += len(found[-1].q)
        progress("geometry", k + 1, effort.rounds)
        if count >= effort.enough:
            break
    rows = joined(found)
    if len(rows.q):
        progress("geometry, changed", 0, effort.changes)
    for k in range(effort.changes if len(rows.q) else 0):
        rows = best_of(rows, count=effort.enough, each=effort.enough // 6)
        rows = improved(whole, balls, rows, rng, size=0.3 / (1.0 + 0.25 * k), touch=touch)
        progress("geometry, changed", k + 1, effort.changes)
    return rows


def _softened(evaluator: Evaluator, effort: Effort, worth: list[Evaluation]) -> list[Evaluation]:
    """Return what was judged by verdicts with small changes of its best, generation by generation.

    Verdicts cost less than throws. What geometry finds soft asks the drives for too much at first;
    small changes lead from there to what they can do, and seldom from what is hard to what is soft.
    """
    pool = list(worth)
    for generation in range(effort.generations):
        parents = best_by_price(pool, 2 * effort.parents)
        children = _changed(evaluator, effort, parents, (_BY_VERDICTS, generation))
        name = part_of("changing", generation, effort.generations)
        pool += evaluator.try_all(name, children, Procedure(how="glance"))
    return pool


def _refined(evaluator: Evaluator, effort: Effort, pool: list[Evaluation]) -> list[Evaluation]:
    """Return the pool with small changes of its best, generation by generation."""
    for generation, throws in enumerate(effort.throws[1:]):
        parents = best_by_price(pool, effort.parents)
        if not parents:
            break
        parts = len(effort.throws) - 1
        how: How = "quick" if throws == effort.throws[0] else "many"
        by = Procedure(throws=throws, seed=_COMPARE + throws, how=how, images=effort.images)
        if throws > parents[0].thrown:  # what was best on a few throws was lucky as well
            again = [w.candidate for w in parents]
            name = part_of("comparing", generation, parts)
            parents = evaluator.try_all(name, again, replace(by, give_up=False))
            pool = list(parents)
        children = _changed(evaluator, effort, parents, (_BY_THROWS, generation))
        name = part_of("improving", generation, parts)
        pool += evaluator.try_all(name, children, replace(by, least=0.2))
    return pool


def _changed(
    evaluator: Evaluator, effort: Effort, parents: Sequence[Evaluation], of: tuple[int, int]
) -> list[Candidate]:
    """Return small changes of candidates, of a stage and generation; later ones are smaller."""
    task, (stage, generation) = evaluator.task, of
    count = effort.children if stage == _BY_THROWS else effort.offspring
    size = effort.size / (1.0 + 0.35 * generation)
    children = list[Candidate]()
    for k in range(count if parents else 0):
        rng = np.random.default_rng([task.seed, stage, generation, k])
        parent = parents[int(rng.integers(len(parents)))]
        moves = task.balls.aim is None
        children.append(mutated(evaluator.whole, parent.candidate, rng, size=size, moves=moves))
    return children


def best_by_price(pool: Sequence[Evaluation], count: int) -> list[Evaluation]:
    """Return the best few, for each of :data:`PRICES` in turn; those with throws come first."""
    out, left = list[Evaluation](), list(pool)
    for price in cycle(PRICES):
        if not left or len(out) == count:
            break
        best = max(left, key=lambda w: (w.thrown > 0, w.score(price)))
        left.remove(best)
        out.append(best)
    return out


def ranked(pool: Sequence[Evaluation], rate: float) -> list[Evaluation]:
    """Return those that catch as many as are asked for, the softest first; then the others.

    Balls caught beyond a limit do not count. Where none catches as many, what catches most is asked
    for. The others follow by their share.
    """
    asked = min(rate, max((w.within for w in pool), default=0.0))
    return sorted(pool, key=lambda w: (0.0, w.hardness) if w.within >= asked else (1.0, -w.share))


def _distinct(worth: Sequence[Evaluation], count: int) -> list[Candidate]:
    """Return the best few for each of :data:`PRICES`, not too many with the same joints."""
    out, seen = list[Candidate](), dict[tuple[int, ...], int]()
    for w in best_by_price(worth, len(worth)):
        key = (*w.candidate.active, w.candidate.catch)
        if seen.get(key, 0) < max(1, count // 3):
            seen[key] = seen.get(key, 0) + 1
            out.append(w.candidate)
        if len(out) == count:
            break
    return out
