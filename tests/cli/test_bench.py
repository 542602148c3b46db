"""``mitt bench --quick``: the keys of the contract, and what is said of a missing library."""

import builtins
import json
from types import ModuleType
from typing import Any

import numpy as np
import pytest

from mitt.cli.main import main
from mitt.core.map.learn import Learned
from mitt.lab.bench import measure as bench
from mitt.lab.bench.problem import judged_anew, learning_problem, solve_problem
from mitt.lab.trials.source import source_of

KEYS = {
    "schema",
    "version",
    "machine",
    "tick_us",
    "tick_without_images_us",
    "adapt_us",
    "learn_ms",
    "learn_solver_ms",
    "learn_ipopt_ms",
    "learn_cost_gap",
    "throws_per_s_core",
    "rivals_us",
    "noise_us",
}
TIME = {"p50", "p99", "p99_9"}


@pytest.fixture
def taught(learned: Learned, monkeypatch: pytest.MonkeyPatch) -> Learned:
    """A map that is there already."""
    monkeypatch.setattr(bench, "learn", lambda _: learned)
    return learned


@pytest.mark.thorough
@pytest.mark.slow
@pytest.mark.usefixtures("taught")
def test_the_json_has_the_keys_of_the_contract(
    monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    """Every key is there, a time has its three figures in order, and stdout is JSON alone."""
    tiny = bench.BenchSettings(throws=1, repeats=20, solves=1, flights=3, ipopt=False)
    monkeypatch.setattr("mitt.cli.measuring.QUICK", tiny)
    assert main(["bench", "--quick", "--json"]) == 0
    result: dict[str, Any] = json.loads(capsys.readouterr().out)
    assert set(result) == KEYS
    assert result["schema"] == bench.SCHEMA
    assert result["learn_ipopt_ms"] is None
    assert result["learn_cost_gap"] is None
    assert result["throws_per_s_core"] > 0.0
    times = [
        result[k]
        for k in (
            "tick_us",
            "tick_without_images_us",
            "adapt_us",
            "learn_ms",
            "learn_solver_ms",
            "noise_us",
        )
    ]
    for time in (*times, *result["rivals_us"].values()):
        assert set(time) == TIME
        assert 0.0 < time["p50"] <= time["p99"] <= time["p99_9"]
    assert {"ruckig", "mpc"} <= set(result["rivals_us"])


def test_a_library_that_is_missing_is_said_and_left_out(
    taught: Learned, monkeypatch: pytest.MonkeyPatch
) -> None:
    """The other rivals are timed all the same; one line names the library."""
    inner = builtins.__import__

    def without(name: str, *rest: Any) -> ModuleType:  # noqa: ANN401 (what __import__ takes)
        if name in ("mink", "pink", "cv2"):
            raise ModuleNotFoundError(f"No module named {name!r}", name=name)
        return inner(name, *rest)

    monkeypatch.setattr(builtins, "__import__", without)
    source = source_of(taught.map.arm, seed=1, count=1, drag=0.04)
    said: list[str] = []
    settings = bench.BenchSettings(throws=1, repeats=20)
    rivals = bench.rivals_of(taught.map, source, [], settings, said.append)
    assert set(rivals) == {"ruckig", "mpc"}
    assert [line.split()[0] for line in said] == ["mink", "pink", "opencv"]
    assert all("mitt[bench]" in line for line in said)


def test_the_learning_problem_is_solved_within_its_bound(taught: Learned) -> None:
    """Rows bind at the optimum, and no small step within them lowers the cost."""
    problem = learning_problem(taught.map.arm, flights=4, seed=2)
    answer = solve_problem(problem)
    assert answer.good
    assert answer.worst == pytest.approx(1.0, abs=1e-5)
    rng = np.random.default_rng(3)
    for _ in range(50):
        near = judged_anew(
            problem, answer.alpha + 1e-4 * rng.standard_normal(problem.size), good=True
        )
        assert near.worst > 1.0 or near.cost > answer.cost - 1e-7
