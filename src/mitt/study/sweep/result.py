"""What the folder of a finished study holds, read back."""

from dataclasses import dataclass
from typing import Any

from mitt.errors import FileError
from mitt.link.files import read_json
from mitt.study.sweep.folder import Folder, read_manifest
from mitt.study.sweep.study import SCHEMA, Study

#: Largest summary that is read [bytes].
_MAX_BYTES = 200_000_000


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class StudyResult:
    """What the folder of a study holds.

    Attributes:
        study: The study.
        folder: The folder.
        rows: Rows of the summary.
    """

    study: Study
    folder: Folder
    rows: list[dict[str, Any]]


def read_result(folder: Folder) -> StudyResult:
    """Read the folder of a study.

    Raises:
        FileError: It holds no study, or one without a summary.
    """
    study = read_manifest(folder.path)
    if not folder.summary.exists() or not folder.trials.exists():
        raise FileError(str(folder.path), "a study with a summary", "one that is not over",
                        do="finish it with mitt study --resume")  # fmt: skip
    raw = read_json(folder.summary, max_bytes=_MAX_BYTES)
    if not isinstance(raw, dict) or raw.get("schema") != SCHEMA:
        raise FileError(str(folder.summary), f"schema {SCHEMA}", "another")
    return StudyResult(study=study, folder=folder, rows=raw["rows"])
