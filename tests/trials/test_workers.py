"""Studies by processes and clusters, and what becomes of workers that die."""

import os
import signal
import subprocess
import sys
import time
from multiprocessing import resource_tracker
from pathlib import Path

import dying_workers
import pytest
from dying_workers import aborts_at_three, raises_at_three, work
from small_study import TEXT, quiet, ready, thrown_again, write_study
from support import thorough

from mitt.core.errors import InputError
from mitt.core.map.learn import Learned
from mitt.lab.trials.study_folder import Folder
from mitt.lab.trials.study_run import run_study
from mitt.lab.trials.workers import Cluster, Processes, engine_of, run_tasks

COMPARED = ("summary.json", "trials.parquet")


def _files(folder: Path) -> list[bytes]:
    """Return what two runs of a study are compared by."""
    return [(folder / name).read_bytes() for name in COMPARED]


@pytest.mark.thorough
@pytest.mark.slow
def test_a_cluster_comes_to_what_one_process_does_byte_by_byte(
    tmp_path: Path, learned: Learned, thrown_study: Path
) -> None:
    distributed, study = pytest.importorskip("distributed"), write_study(tmp_path, TEXT)
    folder = ready(tmp_path / "out", study, learned)
    with distributed.LocalCluster(
        n_workers=1,
        threads_per_worker=2,
        processes=False,
        dashboard_address=None,
        host="127.0.0.1",
        protocol="tcp",
    ) as cluster:
        engine = Cluster(cluster.scheduler_address.replace("tcp://", "dask://"))
        assert run_study(study, folder, engine, progress=quiet).status == 0
    assert _files(folder.path) == _files(thrown_study)


@pytest.mark.thorough
@pytest.mark.slow
def test_a_worker_that_aborts_takes_few_tasks_with_it_and_the_others_go_on() -> None:
    engine = Processes(2)
    try:
        got = dict(run_tasks(engine, aborts_at_three, range(12), window=3))
    finally:
        engine.close(at_once=True)
    dead = {number: what for number, what in got.items() if not isinstance(what, bytes)}
    assert 3 in dead
    assert len(dead) <= 3
    assert all(engine.died(error) for error in dead.values())
    assert all(got[number] == work(number) for number in set(range(12)) - set(dead))


def test_processes_that_are_dropped_leave_no_semaphore(monkeypatch: pytest.MonkeyPatch) -> None:
    """Python tells of those that are left where a process ends by a signal."""
    left, engine = set[str](), Processes(1)
    monkeypatch.setattr(resource_tracker, "register", lambda name, _: left.add(name))
    monkeypatch.setattr(resource_tracker, "unregister", lambda name, _: left.discard(name))
    engine.submit(work, 1)
    assert left
    engine.close(at_once=True)
    assert not left


@pytest.mark.slow
def test_a_task_that_raises_costs_nobody_else_anything() -> None:
    engine = Processes(1)
    try:
        got = dict(run_tasks(engine, raises_at_three, range(6), window=2))
    finally:
        engine.close(at_once=False)
    assert isinstance(got.pop(3), ValueError)
    assert got == {number: work(number) for number in (0, 1, 2, 4, 5)}


@pytest.mark.thorough
@pytest.mark.slow
def test_what_a_chunk_cannot_be_thrown_for_is_one_line_and_bad_input(
    tmp_path: Path, learned: Learned
) -> None:
    """Speeds that no throw has: the worker lives, its reason is told, the status is 2."""
    text = TEXT[: TEXT.index('\n[[conditions]]\nname = "blind"')]
    text += "throws = { speed = [90.0, 91.0] }\n"
    study = write_study(tmp_path, text)
    folder = ready(tmp_path / "out", study, learned)
    engine = Processes(1)
    finished = run_study(study, folder, engine, progress=quiet)
    assert finished.status == 2
    assert len(finished.lost) == 4
    assert all("a release speed of 90 to 91 m/s" in line for line in finished.lost)
    assert not any("died" in line for line in finished.lost)


def _start(study: Path, out: Path) -> "subprocess.Popen[bytes]":
    """Start ``mitt study --resume`` as a process, with two workers."""
    words = ["study", str(study), "--out", str(out), "--workers", "2", "--resume"]
    return subprocess.Popen(
        [sys.executable, "-m", "mitt", *words], stdout=subprocess.DEVNULL, stderr=subprocess.PIPE
    )


def _until_thrown(folder: Folder, count: int) -> None:
    """Wait until so many chunks of a study have been thrown."""
    for _ in range(1200):
        if len(list((folder.path / "parts").glob("part-*"))) >= count:
            return
        time.sleep(0.05)
    raise AssertionError("nothing is thrown")


@pytest.mark.thorough
@pytest.mark.slow
def test_kill_9_loses_no_throw_and_doubles_none(
    tmp_path: Path, learned: Learned, thrown_study: Path
) -> None:
    """After a kill two workers finish; all is byte by byte as of one process without a kill."""
    study = write_study(tmp_path, TEXT)
    folder = ready(tmp_path / "out", study, learned)
    process = _start(tmp_path / "study.toml", folder.path)
    _until_thrown(folder, 3)
    process.kill()
    process.communicate()
    last = _start(tmp_path / "study.toml", folder.path)
    assert last.wait(120) == 0
    assert _files(folder.path) == _files(thrown_study)


@pytest.mark.thorough
@pytest.mark.slow
def test_an_interrupt_keeps_what_is_done_and_says_130(tmp_path: Path, learned: Learned) -> None:
    study = write_study(tmp_path, TEXT.replace("throws = 2", "throws = 400"))
    folder = ready(tmp_path / "out", study, learned)
    process = _start(tmp_path / "study.toml", folder.path)
    _until_thrown(folder, 1)
    process.send_signal(signal.SIGINT)
    _, said_last = process.communicate(timeout=60)
    assert process.returncode == 130
    assert b"Traceback" not in said_last
    assert folder.summary.exists()
    assert folder.trials.exists()


def test_a_scheduler_that_does_not_answer_is_one_line(monkeypatch: pytest.MonkeyPatch) -> None:
    pytest.importorskip("distributed")
    monkeypatch.setattr("mitt.lab.trials.workers._ANSWER", "300ms")
    start = os.times().elapsed
    with pytest.raises(InputError, match="Dask scheduler that answers"):
        engine_of("dask://127.0.0.1:9", None)
    assert os.times().elapsed - start < 60.0  # generous: it must end, not be fast


@pytest.mark.parametrize(
    "name", ["", "remote", "dask://", "dask://host", "tcp://host:1", "dask://h:x"]
)
def test_an_engine_that_is_none_is_refused(name: str) -> None:
    with pytest.raises(InputError, match="local or dask://HOST:PORT"):
        engine_of(name, None)


@pytest.mark.parametrize("workers", [0, -1, 100_000])
def test_a_number_of_workers_that_cannot_be_meant_is_refused(workers: int) -> None:
    with pytest.raises(InputError, match="--workers"):
        engine_of("local", workers)


@pytest.mark.thorough
@pytest.mark.slow
def test_a_full_disk_is_one_line_and_what_is_done_is_kept(
    tmp_path: Path, thrown_study: Path
) -> None:
    """A part does not fit, so that it is not there, and all others are."""
    _, folder = thrown_again(thrown_study, tmp_path)
    folder.part(5).unlink()
    code = (
        "import resource, sys; from mitt.cli.main import main; "
        "resource.setrlimit(resource.RLIMIT_FSIZE, (4000, 4000)); sys.exit(main(sys.argv[1:]))"
    )
    words = [
        "study",
        str(tmp_path / "study.toml"),
        "--out",
        str(folder.path),
        "--workers",
        "1",
        "--resume",
    ]
    done = subprocess.run([sys.executable, "-c", code, *words], capture_output=True, check=False)
    assert done.returncode == 2
    assert done.stderr.decode().strip().splitlines()[-1].startswith("mitt: ")
    assert b"wanted a file that can be written" in done.stderr
    assert [k for k in range(12) if not folder.part(k).exists()] == [5]
    assert not list((folder.path / "parts").glob(".*"))


#: What is told of each death, and after how many of them.
TOLD = {
    "raises": ("cannot begin: RuntimeError: two lines", 1),
    "refuses": ("cannot begin: worker: wanted a package", 1),
    "exits": ("ended with status 7", 2),
    "killed": ("killed by SIGKILL, as where memory runs out", 2),
    "aborts": ("killed by SIGABRT", 2),
    "at work": ("killed by SIGKILL", 6),
}


def test_each_way_to_die_is_told() -> None:
    assert tuple(TOLD) == dying_workers.DEATHS


@pytest.mark.parametrize("how", thorough(dying_workers.DEATHS[:4], dying_workers.DEATHS[4:]))
def test_workers_that_die_again_and_again_end_by_one_line(
    how: str, monkeypatch: pytest.MonkeyPatch, capfd: pytest.CaptureFixture[str]
) -> None:
    """However many tasks wait: few processes are started, and they print nothing themselves."""
    monkeypatch.setenv("MITT_DIES", how)
    told, most = TOLD[how]
    engine, outcomes = Processes(1), list[bytes | BaseException]()

    def work() -> None:
        for _, outcome in run_tasks(engine, dying_workers.work, range(1000), window=2):
            outcomes.append(outcome)

    with pytest.raises(InputError) as stop:
        work()
    engine.close(at_once=True)
    assert all(isinstance(outcome, BaseException) for outcome in outcomes)
    assert told in str(stop.value)
    assert "\n" not in str(stop.value)
    assert len(outcomes) <= 2 * most  # two tasks are under way at a time
    assert "Traceback" not in capfd.readouterr().err


def test_a_worker_that_is_killed_now_and_then_ends_nothing() -> None:
    """As long as tasks are done in between, others take the place of the dead."""
    engine, done, deaths = Processes(1), 0, 0
    for _, outcome in run_tasks(engine, dying_workers.work, range(30), window=1):
        if isinstance(outcome, bytes):
            done += 1
            assert engine._pool is not None
            if done % 12 == 1 and deaths < 2:
                for pid in engine._pool.executor._processes:
                    os.kill(pid, signal.SIGKILL)
        else:
            deaths += 1
    engine.close(at_once=True)
    assert deaths >= 2
    assert done + deaths == 30
