"""The folder of a study, and who may write to it; needs no pyarrow.

study.json       the study, spelled out, and its digest
maps/            learned maps, one an arm with its limits
flights/         recorded flights that are thrown, named by what they hold
parts/           one Parquet file a chunk, whole or not there
recordings/      failures
trials.parquet   all throws, one row each
summary.json     rates by generator and condition; follows from the table, and is never read back
timing.json      wall-clock figures, which no comparison reads
"""

import hashlib
from collections.abc import Callable
from pathlib import Path
from typing import TypeVar, final

from mitt.core import checks
from mitt.core.errors import FileError, InputError
from mitt.io.arm_file import ArmSpec
from mitt.io.csv_table import MAX_BYTES
from mitt.io.reading import changed_file, read_bytes, read_json
from mitt.io.schema import FileSettings, validated
from mitt.io.writing import (
    Leaves,
    claim_folder,
    clear_temporary,
    file_name,
    make_folder,
    write_bytes,
    write_json,
)
from mitt.lab.trials.study import Study

MANIFEST = "study.json"
"""File that says which study a folder belongs to."""

_MANIFEST_SCHEMA = "mitt.study-run/1"
LEAVES = Leaves(
    command="mitt study",
    schema=_MANIFEST_SCHEMA,
    manifests=(MANIFEST,),
    names=(
        r"study\.json",
        r"maps/map-[0-9a-f]{12}\.json",
        r"flights/[0-9a-f]{16}\.csv",
        r"parts/part-\d{6,}\.parquet",
        r"recordings/.+-\d+\.mcap",
        r"replays/.+-\d+\.html",
        r"trials\.parquet",
        r"summary\.json",
        r"timing\.json",
        r"report\.html",
    ),
)
"""All that a study leaves in its folder."""


@final
class Folder:
    """The folder of a study."""

    def __init__(self, path: Path) -> None:
        """Take the place; nothing is read or written yet."""
        self.path = path

    @property
    def recordings(self) -> Path:
        """Where recordings are kept."""
        return self.path / "recordings"

    @property
    def trials(self) -> Path:
        """The table of all throws."""
        return self.path / "trials.parquet"

    @property
    def summary(self) -> Path:
        """The summary."""
        return self.path / "summary.json"

    def part(self, number: int) -> Path:
        """Return where the part of a chunk is kept."""
        return self.path / "parts" / f"part-{number:06d}.parquet"

    def map(self, arm: ArmSpec) -> Path:
        """Return where the map of an arm is kept."""
        name = hashlib.sha256(arm.model_dump_json().encode()).hexdigest()[:12]
        return self.path / "maps" / f"map-{name}.json"

    def flights(self, study: Study, address: str) -> Path:
        """Return where the recorded flights of an address are kept; copied there when first asked.

        Raises:
            FileError: The file is not there any more, or holds something else.
        """
        digest = study.flights[address]
        kept = self._flights(digest)
        place = kept if kept.exists() else Path(address)
        content = read_bytes(place, max_bytes=MAX_BYTES, wanted="a readable CSV file")
        if hashlib.sha256(content).hexdigest() != digest:
            raise FileError(str(place), "the flights that the study was made with", "others")
        if place is not kept:
            write_bytes(kept, content)
        return kept

    def _flights(self, digest: str) -> Path:
        """Return where recorded flights of a digest are kept."""
        return self.path / "flights" / f"{digest[:16]}.csv"

    def recording(self, generator: str, condition: str, index: int) -> Path:
        """Return where the recording of a throw is kept."""
        return self.path / "recordings" / f"{throw_name(generator, condition)}-{index}.mcap"

    def claim(self, study: Study, *, resume: bool, overwrite: bool) -> None:
        """Make the folder ready for a study.

        Raises:
            InputError: It has files in it and neither option was said, or it is another study's.
            FileError: It cannot be made or written.
        """
        if not (resume and self._is_ours(study)):
            flights = [x for a, d in study.flights.items() for x in (Path(a), self._flights(d))]
            claim_folder(
                self.path,
                LEAVES,
                overwrite=overwrite or resume,
                made=self._made(),
                keep=(self.path / MANIFEST, *flights),
            )
            write_json(self.path / MANIFEST, _manifest(study))
        make_folder(self.path / "parts")
        clear_temporary(self.path, LEAVES)

    def _made(self) -> Callable[[str], bool]:
        """Return what says whether the study of this folder made a file: its throws have names."""
        raw = read_json(self.path / MANIFEST) if LEAVES.owns(self.path) else {}
        told = raw.get("study")
        conditions = told.get("conditions") if isinstance(told, dict) else None
        names = {
            throw_name(str(generator), str(condition.get("name")))
            for condition in (conditions if isinstance(conditions, list) else ())
            if isinstance(condition, dict) and isinstance(condition.get("counts"), dict)
            for generator in condition["counts"]
        }

        def made(name: str) -> bool:
            inner, _, last = name.partition("/")
            return inner not in ("recordings", "replays") or last.rpartition("-")[0] in names

        return made

    def check(self, study: Study, *, resume: bool) -> None:
        """Refuse a folder that a study cannot go on in; for resuming only."""
        if resume:
            self._is_ours(study)

    def _is_ours(self, study: Study) -> bool:
        """Say whether the folder holds the beginning of this study; False where it is empty."""
        files = [p for p in self.path.glob("*") if not p.name.startswith(".")]
        if not files:
            return False
        manifest = self.path / MANIFEST
        if not manifest.exists():
            raise InputError("--resume", "the folder of a study", f"{self.path}, which is none")
        given = read_json(manifest)
        digest = given.get("digest") if isinstance(given, dict) else None
        if digest != study.digest:
            raise InputError(
                "--resume",
                f"a folder of the study {study.name!r} as it is now",
                f"{self.path}, made by {_other(given, study)}",
                do="choose another folder or say --overwrite instead",
            )
        return True


def throw_name(generator: str, condition: str) -> str:
    """Return what the files of a throw begin with: no other generator and condition have it."""
    return f"{file_name(generator)}+{file_name(condition)}"  # no name of a file has a plus


def _other(given: object, study: Study) -> str:
    """Return in words what made a folder that is not of this study."""
    if not isinstance(given, dict):
        return "another study"
    if given.get("version") != study.version:
        return f"a study of mitt {given.get('version')}"
    try:
        was = validated(type(study), given.get("study"), place=MANIFEST)
    except InputError:
        return "another study"
    for name, origin in study.plugins.items():
        before = was.plugins.get(name, origin)
        if before != origin:
            return f"generator {name!r} of {before}; now {origin}"
    for name, digest in study.flights.items():
        if was.flights.get(name, digest) != digest:
            return f"another content of {name}"
    for old, new in zip(was.conditions, study.conditions, strict=False):
        name = changed_file(old.arm_files, new.arm_files)
        if name and old == new.model_copy(update={"arm_files": old.arm_files}):
            return f"another content of {name}"
    return "another study"


def _manifest(study: Study) -> dict[str, object]:
    """Return what ``study.json`` says."""
    return {
        "schema": _MANIFEST_SCHEMA,
        "version": study.version,
        "digest": study.digest,
        "study": study.model_dump(mode="json"),
    }


def task_of_folder(path: Path) -> str:
    """Return the task of the study that a folder holds; of catching where it says none."""
    raw = read_json(path / MANIFEST) if (path / MANIFEST).is_file() else None
    study = raw.get("study") if isinstance(raw, dict) else None
    return str(study.get("task", "catch")) if isinstance(study, dict) else "catch"


_Kind = TypeVar("_Kind", bound=FileSettings)


def read_manifest(path: Path, kind: type[_Kind]) -> _Kind:
    """Return the study that a folder was made by.

    Args:
        path: The folder.
        kind: What kind of study.

    Raises:
        FileError: The folder holds no study.
    """
    path = checks.path("study", path)
    if not (path / MANIFEST).is_file():
        if (path / "result.json").is_file():
            raise FileError(
                str(path),
                "the folder of a study",
                "one of mitt catch",
                do="its page is report.html, written by mitt catch itself",
            )
        raise FileError(str(path), "the folder of a study, with study.json in it", "none")
    raw = read_json(path / MANIFEST)
    if not isinstance(raw, dict) or raw.get("schema") != _MANIFEST_SCHEMA:
        raise FileError(str(path / MANIFEST), f"schema {_MANIFEST_SCHEMA}", "another")
    return validated(kind, raw.get("study"), place=str(path / MANIFEST))


def notes_of(study: Study) -> dict[str, str]:
    """Return what the metadata of a table say of its study."""
    return {
        "schema": study.kind.schema,
        "study": study.name,
        "digest": study.digest,
        "seed": str(study.seed),
        "version": study.version,
    }
