"""How much a search looks at: a number of candidates for each stage, by name."""

from dataclasses import dataclass, replace


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
        again: How many of them are thrown at further: the best of several was lucky as well.
        report: Fresh throws at the chosen one, which alone are reported.
        speeds: Speeds of throws of which the page tells, rising [m/s].
        each_speed: Throws at each of these.
        sure: Fresh throws at the fastest of them that is caught.
        grid: Points of the region of balls on each side of its middle.
        slower: Searches for slower throws where the default ones are not caught.
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
    confirm: int = 50
    again: int = 4
    report: int = 100
    speeds: tuple[float, ...] = (3.0, 4.0, 5.0, 6.0, 7.0, 8.0, 9.0)
    each_speed: int = 12
    sure: int = 50
    grid: int = 8
    slower: int = 3

    def less(self) -> "Effort":
        """Return less of it, for one of several searches."""
        return replace(
            self, judged=self.judged // 3, generations=self.generations // 2,
            thrown=self.thrown // 2, throws=self.throws[:3], last=1, confirm=self.throws[0],
        )  # fmt: skip

    def halved(self) -> "Effort":
        """Return it with half as many candidates, for an arm with one set of three joints.

        Rounds of small changes by verdicts are two thirds, those by throws two less.
        """
        return replace(
            self, judged=(self.judged + 1) // 2, generations=(2 * self.generations + 2) // 3,
            offspring=(self.offspring + 1) // 2, thrown=(self.thrown + 1) // 2,
            throws=self.throws[:-2], parents=(self.parents + 1) // 2,
            children=(self.children + 1) // 2, last=self.last // 2, again=self.again // 2,
        )  # fmt: skip


#: Where just so few joints may move, and from so many on, less is looked at in full.
_FEW, _MANY = 3, 5
#: By name: what ``mitt design --effort`` may ask for.
EFFORTS = {
    "quick": Effort(rounds=2, changes=8, judged=16, generations=4, offspring=40, thrown=6,
                    throws=(12, 12), children=8, last=1, confirm=20),
    "full": Effort(),
}  # fmt: skip


def effort_of(name: str, joints: int) -> Effort:
    """Return how much is looked at.

    Args:
        name: One of :data:`EFFORTS`.
        joints: How many joints may move. In full, half as many candidates do where there are three;
            where there are many, each takes longer, and one round by throws less is made.
    """
    effort = EFFORTS[name]
    if name == "full" and joints == _FEW:
        return effort.halved()
    if name == "full" and joints >= _MANY:
        return replace(effort, throws=effort.throws[:-1])
    return effort
