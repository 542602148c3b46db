"""A study, of whatever task: many trials of several generators under a grid of conditions.

The same targets or balls come for every generator: those of the seed. A task derives its study from
:class:`Study`: what a condition is beyond the common part, and how trials are run.
"""

import hashlib
from abc import abstractmethod
from collections.abc import Mapping, Sequence
from dataclasses import asdict, dataclass
from pathlib import Path
from typing import Annotated, Any, ClassVar, Final, NamedTuple, Protocol, final

from pydantic import Field

from mitt.clock import Progress, Stopwatch
from mitt.core.errors import FileError
from mitt.io.arm_file import ArmSpec
from mitt.io.reading import changed_file
from mitt.io.recordings import Recording
from mitt.io.schema import FileSettings
from mitt.io.writing import json_digest
from mitt.lab.trials.prepared import Trials
from mitt.lab.trials.scored_task import Row, ScoredTask
from mitt.lab.world.flights import RecordedFlight
from mitt.lab.world.scene import Scene

REFERENCE: Final = "direct"
"""The generator that all others are compared with."""

#: Below this corrected p a difference counts.
_SURE = 0.05


class Player(NamedTuple):
    """A generator, at a rate where it plans.

    Attributes:
        name: Its name.
        rate: Plans a second [Hz]; None where it does not plan at a rate.
    """

    name: str
    rate: float | None = None

    @property
    def label(self) -> str:
        """What tables call it."""
        return self.name if self.rate is None else f"{self.name} {self.rate:g} Hz"


class Condition(FileSettings):
    """One condition with everything in its place; what a task adds stands in a derived class.

    Attributes:
        name: What it is called, unique in a study.
        disturbance: The sweep that it belongs to, or its own name.
        value: Its value in the sweep.
        unit: Unit of the value.
        counts: Trials of each generator, by its name.
        scene: The world.
        arm_files: Digests of what the arm was read from, by name, in the order of reading: an arm
            file, its description, meshes, limits.
    """

    name: str
    disturbance: str
    value: float | None = None
    unit: str = ""
    counts: dict[str, int]
    scene: Scene
    arm_files: dict[str, str] = Field(default_factory=dict)


class KeptFiles(Protocol):
    """Where the folder of a study keeps what its trials need."""

    def map(self, arm: ArmSpec) -> Path:
        """Return where the map of an arm is kept."""

    def flights(self, study: Any, address: str) -> Path:  # noqa: ANN401 (the study itself)
        """Return where the recorded flights of an address are kept."""


@final
@dataclass(frozen=True, slots=True, kw_only=True)
class Material:
    """What trials need of the folder of their study; a worker need not see the folder.

    Attributes:
        map: The learned map as its file says it; empty where it follows from the study.
        recordings: Recorded flights to throw; none where none are.
    """

    map: str = ""
    recordings: tuple[RecordedFlight, ...] = ()

    @property
    def digest(self) -> str:
        """SHA-256 of the map; empty without one."""
        return hashlib.sha256(self.map.encode()).hexdigest() if self.map else ""


@final
@dataclass(frozen=True, slots=True, kw_only=True)
class Chunk:
    """Some trials of one generator in one condition; sent to a worker.

    Attributes:
        number: Number of the chunk in the study.
        study: The study, with this condition alone.
        player: The generator.
        condition: The condition.
        start: First trial.
        stop: Trial after the last.
        material: What the trials need of the folder.
        notes: What the metadata of a part say of the study.
    """

    number: int
    study: "Study"
    player: Player
    condition: Any
    start: int
    stop: int
    material: Material
    notes: tuple[tuple[str, str], ...]

    @property
    def place(self) -> tuple[str, str]:
        """Names of the generator and of the condition."""
        return self.player.label, self.condition.name

    @property
    def trials(self) -> range:
        """Its trials."""
        return range(self.start, self.stop)


class Study(FileSettings):
    """A study that can run: all conditions spelled out.

    Attributes:
        kind: The task, as its trials are counted.
        task: Name of the task.
        name: What it is called.
        about: What it asks, for the page.
        seed: Seed of targets or balls, plant and noise; the same for all generators.
        conditions: All conditions.
        chunk: Trials of one piece of work.
        record: Most failures to record, of each generator in each condition.
        version: Version of mitt.
        flights: Digests of the files of recorded flights, by their address.
        plugins: Package, version and digest of the generators that other packages add.
    """

    kind: ClassVar[ScoredTask]

    task: str
    name: str
    about: str
    seed: int
    conditions: Annotated[tuple[Any, ...], Field(strict=False)]
    chunk: int
    record: int
    version: str
    flights: dict[str, str] = Field(default_factory=dict)
    plugins: dict[str, str] = Field(default_factory=dict)

    @property
    def digest(self) -> str:
        """SHA-256 of all that decides the results; of files what they hold, not where they lie."""
        decisive = self.model_dump(mode="json", exclude={"about", "record", "flights"})
        for condition in decisive["conditions"]:
            if address := condition.get("flights"):
                condition["flights"] = self.flights.get(address, address)
            condition["arm_files"] = list(condition["arm_files"].values())
            _without_places(condition)
        _without_places(decisive)
        return json_digest(decisive)

    @property
    def generators(self) -> tuple[str, ...]:
        """Names of the generators of all conditions."""
        return tuple(dict.fromkeys(name for c in self.conditions for name in c.counts))

    @property
    @abstractmethod
    def setting(self) -> str:
        """What its page says of arm and vision, in words."""

    def players(self, condition: Any) -> tuple[Player, ...]:  # noqa: ANN401 (one of its own)
        """Return the generators that are tried in a condition."""
        return tuple(Player(name) for name in condition.counts)

    def cells(self, rows: Sequence[Row]) -> list[tuple[Any, Row]]:  # noqa: ARG002 (has no map)
        """Return the cells of its map as conditions, with their rows; none where it has no map."""
        return []

    def check(self) -> Sequence[str]:
        """Refuse what cannot run, before anything does; return warnings."""
        return ()

    def material(
        self,
        condition: Any,  # noqa: ANN401, ARG002 (one of its own)
        folder: KeptFiles,  # noqa: ARG002
        progress: Progress,  # noqa: ARG002
    ) -> Material:
        """Return what trials of a condition need of the folder, made where it is not there."""
        return Material()

    @abstractmethod
    def played(self, chunk: Chunk) -> tuple[list[dict[str, Any]], Stopwatch]:
        """Run the trials of a chunk; return them by their fields, and the times of the ticks."""

    @abstractmethod
    def recorded(self, chunk: Chunk, index: int) -> Recording:
        """Run a trial of a chunk once more, which gives the same, and return its recording."""

    def answer(self, rows: Sequence[Row]) -> list[str]:
        """Return what the rows of the summary say, a sentence for each condition and measure."""
        out, task = list[str](), self.kind
        words = {name: x.words for name, x in task.measures.items()}
        for condition in dict.fromkeys(row["condition"] for row in rows):
            cells = {row["generator"]: row for row in rows if row["condition"] == condition}
            if REFERENCE in cells and any(row["against_direct"] for row in cells.values()):
                out += [
                    f"{condition}, {text}: {_places(task, cells, name)}."
                    for name, text in {task.success: task.counted, **words}.items()
                ]
        return out


class RunnerStudy(Study):
    """A study whose trials are all that the runner of its task makes of them."""

    @abstractmethod
    def runner(self, chunk: Chunk, *, keeps: bool = False) -> Trials:
        """Return a fresh runner for a chunk, so that none depends on one before it.

        Args:
            chunk: Its trials.
            keeps: Whether it keeps what the catcher takes, for a recording.
        """

    def played(self, chunk: Chunk) -> tuple[list[dict[str, Any]], Stopwatch]:
        """Run the trials of a chunk; return them by their fields, and the times of the ticks."""
        runner = self.runner(chunk)
        return [asdict(runner.trial(k)) for k in chunk.trials], runner.stopwatch

    def recorded(self, chunk: Chunk, index: int) -> Recording:
        """Run a trial of a chunk once more, which gives the same, and return its recording."""
        runner = self.runner(chunk, keeps=True)
        return runner.recording(runner.trial(index))


def _without_places(said: dict[str, Any]) -> None:
    """Replace an arm and limits that are files by their kind: what they hold is said elsewhere."""
    for name in {"arm", "limits"} & said.keys():
        if isinstance(said[name], dict):
            _without_places(said[name])
        elif isinstance(said[name], str):
            said[name] = Path(said[name]).suffix or said[name]


def _places(task: ScoredTask, cells: Mapping[str, Row], name: str) -> str:
    """Return in words whom the map is better than in a measure, and who is better than it."""
    groups: dict[str, list[str]] = {"better than": [], "worse than": [], "not told apart from": []}
    for label, row in cells.items():
        if row["against_direct"]:
            pair = row["against_direct"]
            of = pair if name == task.success else pair[name]
            mine, other = ("only_direct", "only_this") if of is pair else ("direct", "this")
            kind = "better than" if of[mine] > of[other] else "worse than"
            kind = kind if of["p_holm"] < _SURE else "not told apart from"
            groups[kind].append(f"{label} ({_figure(task, row, name)})")
    said = [f"{kind} {', '.join(labels)}" for kind, labels in groups.items() if labels]
    return f"the map ({_figure(task, cells[REFERENCE], name)}) is {'; '.join(said)}"


def _figure(task: ScoredTask, row: Row, name: str) -> str:
    """Return the figure of a cell: how many succeeded, or the median."""
    if name == task.success:
        return f"{row[name]} of {row[task.trials]}"
    return "none" if row[name] is None else f"{row[name]['median']:.3g}"


def planned(study: Study) -> int:
    """Return the number of trials of a study."""
    return sum(c.counts[x.name] for c in study.conditions for x in study.players(c))


def extent(study: Study, trials: int) -> str:
    """Return how large a study is: ``9 generators, 1 condition, 2,700 throws``."""
    labels = {x.label for c in study.conditions for x in study.players(c)}
    counts = {
        "generator": len(labels),
        "condition": len(study.conditions),
        study.kind.trials.removesuffix("s"): trials,
    }
    return ", ".join(f"{n:,} {what}{'s' * (n != 1)}" for what, n in counts.items())


def check_files(condition: Condition, files: Mapping[str, str]) -> None:
    """Refuse an arm that was read from other files than those of a study."""
    if name := changed_file(condition.arm_files, dict(files)):
        raise FileError(
            name,
            "the file that the study was made with",
            "another content",
            do="put it back, or begin the study anew",
        )
