"""Workers that die again and again end a command by one line, whatever they die of."""

import os
import signal

import dying_workers
import pytest

from mitt.errors import InputError
from mitt.trials.workers import Processes, run_tasks

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


@pytest.mark.parametrize("how", dying_workers.DEATHS)
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
