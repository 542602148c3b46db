"""Broken and hostile files through the command line: one line and status 2, or they are good."""

import contextlib
import io
import itertools
import resource
import subprocess
import sys
import time
from collections.abc import Callable, Iterator, Sequence
from dataclasses import dataclass, field
from pathlib import Path
from unittest import mock

import numpy as np

from mitt.cli import line
from mitt.cli.main import main
from soak.mutants import mutant
from soak.readers import SAMPLES
from soak.samples import Sample

#: Longest that a command may take of the processor, which other work may slow down [s], and most
#: memory that it may add [byte].
MOST_TIME = 5.0
MOST_MEMORY = 1_000_000_000
#: Memory of a process that reads one file [byte]; MuJoCo and Numba reserve far more than they use.
_ADDRESS_SPACE = 16_000_000_000


@dataclass(slots=True)
class Found:
    """What the files brought to light.

    Attributes:
        files: Files tried.
        refused: Those that were refused.
        faults: What went wrong, with the file that did it.
    """

    files: int = 0
    refused: int = 0
    faults: list[str] = field(default_factory=list)


def soak(files: int, *, seed: int, folder: Path, keep: Callable[[str, bytes], None]) -> Found:
    """Read ``files`` mutants in this process, all readers in turn.

    Args:
        files: How many.
        seed: Seed of the mutations.
        folder: Where they are put.
        keep: Takes name and content of a file that did harm.
    """
    found, samples = Found(), [sample(folder) for sample in SAMPLES]
    parsed: dict[tuple[str, ...], tuple[str, object]] = {}
    rngs = {sample.name: np.random.default_rng((seed, k)) for k, sample in enumerate(samples)}
    for k, sample in enumerate(itertools.islice(turns(samples), files)):
        rng = rngs[sample.name]
        data = sample.mend(mutant(sample.valid, rng))
        sample.path.write_bytes(data)
        with _parsed_once(parsed):
            fault = _in_process(sample, found)
        found.files += 1
        if fault:
            found.faults.append(f"{sample.name} {k}: {fault}")
            keep(f"{k}-{sample.path.name}", data)
    return found


@contextlib.contextmanager
def _parsed_once(known: dict[tuple[str, ...], tuple[str, object]]) -> Iterator[None]:
    """Let ``main`` parse a command line only once: it is the same for every mutant of a sample.

    Four fifths of the time of a file would go into it.
    """
    parse = line.parse

    def parse_once(words: list[str]) -> tuple[str, object]:
        if tuple(words) not in known:
            known[tuple(words)] = parse(words)
        return known[tuple(words)]

    with mock.patch.object(line, "parse", parse_once):
        yield


def turns(samples: Sequence[Sample]) -> Iterator[Sample]:
    """Yield samples in turn, for ever; what takes long in some rounds only."""
    for turn in itertools.count():
        yield from (sample for sample in samples if turn % sample.each == 0)


def soak_processes(
    files: int, *, seed: int, folder: Path, keep: Callable[[str, bytes], None]
) -> Found:
    """Read ``files`` mutants in a process each, which may die without taking us along."""
    found, samples = Found(), [sample(folder) for sample in SAMPLES]
    rng = np.random.default_rng((seed, 1_000_003))
    for k, sample in enumerate(itertools.islice(turns(samples), files)):
        data = sample.mend(mutant(sample.valid, rng))
        sample.path.write_bytes(data)
        fault = _as_process(sample, found)
        found.files += 1
        if fault:
            found.faults.append(f"{sample.name} process {k}: {fault}")
            keep(f"process-{k}-{sample.path.name}", data)
    return found


def _in_process(sample: Sample, found: Found) -> str:
    """Run the command here; return what went wrong.

    What takes too long is run again: the first time may have compiled a kernel.
    """
    fault, took = _run(sample, found)
    if not fault and took > MOST_TIME:
        fault, took = _run(sample, Found())
    return f"took {took:.1f} s" if not fault and took > MOST_TIME else fault


def _run(sample: Sample, found: Found) -> tuple[str, float]:
    """Run the command here; return what went wrong, and the processor's time [s]."""
    out, err = io.StringIO(), io.StringIO()
    before, start = _memory(), time.process_time()
    try:
        with contextlib.redirect_stdout(out), contextlib.redirect_stderr(err):
            status = main(sample.command)
    except BaseException as error:
        return f"left main: {type(error).__name__}: {error}", 0.0
    took, grown = time.process_time() - start, _memory() - before
    found.refused += status == 2
    if grown > MOST_MEMORY:
        return f"took {grown / 1e6:.0f} MB", took
    return _judge(status, err.getvalue()), took


def _as_process(sample: Sample, found: Found) -> str:
    """Run the command in a process of its own; return what went wrong."""
    command = [sys.executable, "-m", "mitt", *sample.command]
    try:
        done = subprocess.run(
            command, capture_output=True, text=True, check=False, timeout=60.0, preexec_fn=_confine
        )
    except subprocess.TimeoutExpired:
        return "did not end within 60 s"
    found.refused += done.returncode == 2
    return _judge(done.returncode, done.stderr)


def _confine() -> None:
    """Limit the memory of a process."""
    resource.setrlimit(resource.RLIMIT_AS, (_ADDRESS_SPACE, _ADDRESS_SPACE))


def _judge(status: int, said: str) -> str:
    """Say what is wrong with a status and what was said on stderr."""
    if status not in (0, 2):
        return f"status {status}: {said.strip()[:300]}"
    if "Traceback" in said:
        return "a traceback"
    if status == 2 and said.count("\n") != 1:
        return f"{said.count(chr(10))} lines: {said[:200]!r}"
    return ""


def _memory() -> int:
    """Return the largest memory that this process has used [byte]."""
    return resource.getrusage(resource.RUSAGE_SELF).ru_maxrss * 1024
