"""A search that is broken off: what it keeps, and that it goes on to the same design."""

import json
import os
import signal
from collections.abc import Callable
from dataclasses import replace
from pathlib import Path
from types import SimpleNamespace
from unittest.mock import patch

import numpy as np
import pytest
from design.conftest import TINY, silent
from hypothesis import given
from hypothesis import strategies as st

from mitt.cli import designing as command
from mitt.cli.main import main
from mitt.clock import Pace
from mitt.core.arm.arm import Arm
from mitt.core.errors import FileError, InputError
from mitt.interrupts import Interrupted
from mitt.io.arm_file import load_arm
from mitt.lab.design.arm_design import Design, best_so_far, design
from mitt.lab.design.evaluation import Evaluation
from mitt.lab.design.search import EFFORTS, RATE, SearchProgress, search_of, stages
from mitt.lab.design.search_jobs import Answers, Evaluator, Procedure, SearchJob
from mitt.lab.design.task import DesignTask
from mitt.lab.trials.workers import Processes


def breaking(stage: str) -> Callable[[str, int, int], None]:
    """Return what interrupts a search as soon as something is done in a stage."""
    begun = list[str]()

    def progress(name: str, *_: int) -> None:
        if name.startswith(f"designing: {stage}"):
            begun.append(name)
        if len(begun) > 1:
            raise Interrupted(signal.SIGINT)

    return progress


@pytest.mark.thorough
@pytest.mark.slow
def test_a_search_that_is_broken_off_again_and_again_comes_to_the_same_design(
    found: Design, answered: list[bytes], whole: Arm, task: DesignTask, tmp_path: Path
) -> None:
    """Two workers give the answers of none; a search goes on from any of them to the same."""
    search = search_of(whole, task, TINY, joints=None, rate=RATE)
    path = tmp_path / "search.jsonl"

    def searched(progress: Callable[[str, int, int], None], workers: int) -> Design:
        answers = Answers.open(path, search, resume=True)
        engine = Processes(workers) if workers else None
        try:
            return design(whole, task, TINY, progress=progress, engine=engine, answers=answers)
        finally:
            best = best_so_far(whole, answers, RATE)
            assert best.usable if best else workers == 2
            answers.close(done=False)
            if engine is not None:
                engine.close(at_once=True)

    with pytest.raises(Interrupted):
        searched(breaking("learning"), 2)
    first = path.read_bytes().splitlines(keepends=True)
    assert len(first) > 1
    assert set(first) <= set(answered)
    kept = answered[: 9 * len(answered) // 10]
    path.write_bytes(b"".join(kept) + b'["half')  # of a line, as kill -9 leaves
    with pytest.raises(Interrupted):
        searched(breaking("fastest"), 0)
    assert len(kept) < len(path.read_bytes().splitlines()) <= len(answered)
    again = searched(silent, 0)
    mine, other = found.as_json(), again.as_json()
    del mine["seconds"], other["seconds"]
    assert mine == other
    assert found.best is not None
    assert again.best is not None
    np.testing.assert_array_equal(found.best.candidate.q, again.best.candidate.q)


def test_answers_come_back_to_the_bit_and_none_for_another_question(
    found: Design, whole: Arm, task: DesignTask, tmp_path: Path
) -> None:
    """Whatever numbers they have; what was lost with a worker is asked again."""
    assert found.best is not None
    c, path = found.best.candidate, tmp_path / "a.jsonl"
    worth = replace(
        found.best, able=1.0 / 3.0, speed=float("inf"), force=0.1 + 0.2, said="two\nlines"
    )
    by = Procedure(throws=4, seed=7)
    job = SearchJob(number=0, whole=whole, candidate=c, task=task, by=by)
    others = [
        replace(job, by=replace(by, throws=5)),
        replace(job, by=replace(by, seed=8)),
        replace(job, by=replace(by, how="full")),
        replace(job, by=replace(by, least=0.2)),
        replace(job, by=replace(by, give_up=False)),
        replace(job, task=replace(task, seed=9)),
        replace(job, candidate=replace(c, turn=c.turn + 1e-15)),
    ]
    answers = Answers.open(path, "x", resume=False)
    answers.add(job, worth)
    answers.add(others[0], replace(worth, failed="lost"))
    answers.close(done=False)
    answers = Answers.open(path, "x", resume=True)
    assert answers.get(replace(job, number=5, task=replace(task))) is not None
    back = answers.get(job)
    assert back is not None
    assert all(getattr(back, x) == getattr(worth, x) for x in Evaluation.__slots__)
    assert [answers.get(other) for other in others] == [None] * len(others)
    answers.close(done=True)
    assert not path.exists()


def test_answers_of_another_search_are_refused_and_those_in_use(tmp_path: Path) -> None:
    path = tmp_path / "a.jsonl"
    answers = Answers.open(path, "x", resume=False)
    with pytest.raises(InputError, match="where one is looking"):
        Answers.open(path, "x", resume=True)
    head = path.read_bytes()
    path.write_bytes(head + b'["a", {"able": 1.0, "speed": 2.0}]\n')
    answers.close(done=False)
    path.write_bytes(head + b'["a", {"able": 1.0, "speed": 2.0}]\n')
    with pytest.raises(InputError, match="--resume: wanted the arm"):
        Answers.open(path, "y", resume=True)
    Answers.open(path, "x", resume=True).close(done=False)
    assert path.exists()
    for line in (b"[1]", b'["a", {"able": 1.0, "colour": 2}]', b"null", b'{"a": 1}', b"[[[["):
        path.write_bytes(head + line + b"\n")
        with pytest.raises(FileError, match="line 2: wanted an answer"):
            Answers.open(path, "x", resume=True)
    Answers.open(path, "y", resume=False).close(done=False)
    assert not path.exists()  # nothing was answered


def test_all_that_decides_a_search_is_in_its_digest(whole: Arm, task: DesignTask) -> None:
    def of(
        arm: Arm = whole,
        task: DesignTask = task,
        effort: str = "quick",
        joints: list[str] | None = None,
        rate: float = RATE,
    ) -> str:
        return search_of(arm, task, EFFORTS[effort], joints=joints, rate=rate)

    heavier = replace(
        whole.model, links=(*whole.model.links[:-1], replace(whole.model.links[-1], mass=9.0))
    )
    deeper = task.scene.model_copy(update={"floor": -2.0})
    said = [
        of(),
        of(Arm(heavier, whole.limits)),
        of(task=replace(task, seed=4)),
        of(effort="full"),
        of(joints=["j1", "j2", "j4"]),
        of(rate=0.9),
        of(task=replace(task, scene=deeper)),
    ]
    assert len(set(said)) == len(said)
    assert of() == of(task=replace(task))


@pytest.mark.parametrize(("number", "status"), [(signal.SIGINT, 130), (signal.SIGTERM, 143)])
def test_an_interrupt_writes_the_best_so_far_and_says_how_to_go_on(
    number: signal.Signals,
    status: int,
    found: Design,
    tmp_path: Path,
    monkeypatch: pytest.MonkeyPatch,
    capsys: pytest.CaptureFixture[str],
) -> None:
    """The arm file is good; nothing is refused for it when the search goes on."""
    assert found.best is not None
    out, before = tmp_path / "d.toml", list[object]()

    def broken(arm: Arm, task: DesignTask, *_: object, answers: Answers, **__: object) -> Design:
        assert found.best is not None
        before.append(answers.best)
        job = SearchJob(
            number=0,
            whole=arm,
            candidate=found.best.candidate,
            task=task,
            by=Procedure(seed=len(before)),
        )
        answers.add(job, replace(found.best, clean=0))
        if len(before) == 2:
            answers.ended(task, [found.best])
        if len(before) < 3:
            os.kill(os.getpid(), number)
        return found

    monkeypatch.setattr(command, "search_design", broken)
    words = ["design", "wam", "--limits", "wam-80v", "--out", str(out), "--workers", "1"]
    assert main(words) == status
    said = [x for x in capsys.readouterr().err.splitlines() if "compiling" not in x]
    why = f"interrupted by {number.name}; no design catches enough yet"
    assert said == [f"mitt: {why}; --resume goes on with the search"]
    assert not out.exists()
    assert main(words) == 2
    assert "say --resume" in capsys.readouterr().err
    assert main([*words, "--resume"]) == status
    assert f"the best so far, 4 of 4 caught, is in {out}" in capsys.readouterr().err
    arm = load_arm(out)
    assert arm.names == found.joints
    assert "broken off" in out.read_text()
    assert main([*words, "--resume", "--overwrite"]) == 2
    assert main([*words, "--resume", "--check"]) == 0
    assert main([*words, "--resume", "--aim", "0.7,0,0"]) == 2
    assert "--resume: wanted the arm" in capsys.readouterr().err
    assert main([*words, "--resume"]) == 0
    assert "broken off" not in out.read_text()
    assert sorted(x.name for x in tmp_path.iterdir()) == ["d.html", "d.toml"]


def test_a_search_that_has_not_begun_leaves_nothing(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    """Ctrl-C at once, or workers that cannot be: the same command may be said again."""

    def broken(*_: object, **__: object) -> Design:
        os.kill(os.getpid(), signal.SIGINT)
        raise AssertionError

    monkeypatch.setattr(command, "search_design", broken)
    words = ["design", "wam", "--out", str(tmp_path / "d.toml")]
    for _ in range(2):
        assert main([*words, "--workers", "1"]) == 130
        assert main([*words, "--workers", "0"]) == 2
        assert not list(tmp_path.iterdir())
    assert "--workers: wanted a number in 1..1024" in capsys.readouterr().err


def test_what_ends_a_search_by_an_error_keeps_it_as_well(
    found: Design,
    tmp_path: Path,
    monkeypatch: pytest.MonkeyPatch,
    capsys: pytest.CaptureFixture[str],
) -> None:
    def broken(_: Arm, task: DesignTask, *__: object, answers: Answers, **___: object) -> Design:
        assert found.best is not None
        answers.ended(task, [found.best])
        raise InputError("workers", "processes that live", "none")

    monkeypatch.setattr(command, "search_design", broken)
    out = tmp_path / "d.toml"
    assert main(["design", "wam", "--out", str(out), "--workers", "1"]) == 2
    said = [x for x in capsys.readouterr().err.splitlines() if "compiling" not in x]
    assert len(said) == 1
    assert "workers: wanted processes that live, got none; the best so far" in said[0]
    assert load_arm(out)


def test_an_earlier_design_outlives_a_search_without_one(
    found: Design,
    tmp_path: Path,
    monkeypatch: pytest.MonkeyPatch,
    capsys: pytest.CaptureFixture[str],
) -> None:
    """With --overwrite as well: one that finds nothing, and one that is broken off."""
    out, none = tmp_path / "d.toml", replace(found, found=False, best=None, reason="none")
    words = ["design", "wam", "--limits", "wam-80v", "--out", str(out), "--workers", "1"]
    monkeypatch.setattr(command, "search_design", lambda *_, **__: found)
    assert main(words) == 0
    kept = out.read_bytes()
    monkeypatch.setattr(command, "search_design", lambda *_, **__: none)
    assert main([*words, "--overwrite"]) == 0
    assert f"the earlier design in {out} stays" in capsys.readouterr().out.replace("\n", "")

    def broken(_: Arm, task: DesignTask, *__: object, answers: Answers, **___: object) -> Design:
        assert found.best is not None
        answers.ended(task, [found.best])
        raise Interrupted(signal.SIGINT)

    monkeypatch.setattr(command, "search_design", broken)
    assert main([*words, "--overwrite"]) == 130
    assert f"the earlier design in {out} stays; --resume" in capsys.readouterr().err
    assert out.read_bytes() == kept


def test_the_best_so_far_is_of_the_last_stage_that_caught_enough(
    found: Design, whole: Arm, task: DesignTask
) -> None:
    assert found.best is not None
    answers, first = Answers(), replace(found.best, thrown=10, caught=9, clean=9)
    assert answers.best is None
    job = SearchJob(
        number=0, whole=whole, candidate=first.candidate, task=task, by=Procedure(throws=10)
    )
    told = list[str]()
    total = SearchProgress(TINY, lambda name, *_: told.append(name), answers)
    total("throwing", 0, 2)
    answers.add(job, replace(first, clean=2))
    assert answers.best is None
    total("throwing", 1, 2)
    answers.add(job, replace(first, clean=1))
    answers.add(job, first)
    assert answers.best == (task, [first])
    later = replace(first, thrown=50, caught=50, clean=50)
    answers.ended(task, [later, first])
    answers.ended(task, [replace(first, clean=2)])
    assert answers.best == (task, [later, first])
    total("confirming", 1, 1)
    how = f"{first.speed:.1f} m/s, {first.force:.0f} N"
    assert told == [
        "designing: throwing",
        f"designing: throwing (2 of 10 caught, {how})",
        f"designing: confirming (50 of 50 caught, {how})",
    ]


def _search(total: SearchProgress, now: list[float], *, known: int, out: int) -> None:
    """Go through the stages of a search, a second for what takes as long as one throw.

    The first ``known`` are known already, half of the next one too; ``out`` are left out.
    """
    for n, (stage, takes) in enumerate(list(total._takes.items())):
        if n >= len(total._takes) - out:
            break
        first = 8 if n < known else 4 if n == known and n else 0
        total(stage, first, 8)
        for k in range(first, 8):
            now[0] += takes / 8.0
            total(stage, k + 1, 8)


@pytest.mark.parametrize("slower", [False, True])
@pytest.mark.parametrize("name", EFFORTS)
@given(data=st.data())
def test_the_time_left_is_that_of_the_whole_search(
    name: str, slower: bool, data: st.DataObject
) -> None:
    """A search of which much is known, as it is resumed, or which leaves out its last stages.

    What takes time is told as it is, whatever was known before; only what is left out, of which
    nobody knew, was expected.
    """
    effort, now, told = EFFORTS[name], [0.0], list[tuple[float, float]]()
    known = data.draw(st.integers(0, len(stages(effort)) - 1))
    out = data.draw(st.integers(0, 3)) if known < 2 else 0

    def heard(work: str, done: int, of: int) -> None:
        assert work.startswith("designing: ")
        if (left := pace.left(done, of)) is not None:
            told.append((now[0], left))

    with patch("mitt.clock.time", SimpleNamespace(monotonic=lambda: now[0])):
        total, pace = SearchProgress(effort, heard, Answers()), Pace()
        _search(total, now, known=known, out=out)
        if slower:
            told.clear()
            total.again(effort.less())
            for _ in range(effort.slower):
                _search(total, now, known=0, out=0)
        for stage, takes in total._last.items():
            total(stage, 0, 1)
            now[0] += takes
            total(stage, 1, 1)
        total("another", 1, 1)
    assert told[-1][1] == pytest.approx(0.0, abs=5.0)
    for at, left in told if slower or not out else told[-3:]:
        assert left == pytest.approx(now[0] - at, rel=0.05, abs=10.0)


def test_every_stage_of_a_search_is_expected(
    searched: tuple[Design, list[tuple[str, SearchJob]]],
) -> None:
    """A stage that nobody expected would not move the bar."""
    total = SearchProgress(TINY, silent, Answers())
    assert {name for name, _ in searched[1]} <= set(total._takes) | set(total._last)


def test_the_last_throws_are_seen_in_images(
    searched: tuple[Design, list[tuple[str, SearchJob]]],
) -> None:
    """As those of ``mitt catch``; those of the stages before as points."""
    last = {"confirming", "confirming again 1 of 1", "reporting", "speeds", "fastest"}
    seen = {name for name, job in searched[1] if job.by.images}
    assert seen == last & {name for name, _ in searched[1]}
    assert "reporting" in seen


def test_the_evaluator_asks_for_nothing_that_is_known(
    found: Design, whole: Arm, task: DesignTask, monkeypatch: pytest.MonkeyPatch, tmp_path: Path
) -> None:
    assert found.best is not None
    c, asked = found.best.candidate, list[SearchJob]()

    def noted(job: SearchJob) -> Evaluation:
        asked.append(job)
        return Evaluation(candidate=job.candidate, able=0.5, speed=1.0 + job.number)

    monkeypatch.setattr("mitt.lab.design.search_jobs.evaluated", noted)
    for more in (2, 3):
        answers = Answers.open(tmp_path / "a.jsonl", "x", resume=True)
        bench = Evaluator(whole, task, None, silent, answers=answers)
        worth = bench.try_all("some", [replace(c, turn=0.1 * k) for k in range(more)], Procedure())
        assert [w.speed for w in worth] == [1.0 + k for k in range(more)]
        answers.close(done=False)
    assert [job.number for job in asked] == [0, 1, 2]
    assert (
        json.loads((tmp_path / "a.jsonl").read_text().splitlines()[0])["schema"] == "mitt.search/1"
    )
