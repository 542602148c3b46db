"""The comparison with the oracle counts what it says, and asks the oracle only where it must."""

import sys
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from mitt.lab.trials.score import Trial

BENCHMARKS = str(Path(__file__).parents[1] / "benchmarks")
sys.path.append(BENCHMARKS)  # for this module alone: benchmarks have names that tests have as well
from oracle import Row, combined, counted, is_sampled, judged, share  # noqa: E402

sys.path.remove(BENCHMARKS)

#: A trial of which only the fields that count are changed.
PLAIN = Trial(
    index=0,
    status="caught",
    t_catch_s=None,
    position_error_mm=None,
    velocity_error_m_s=None,
    peak_torque_ratio=[],
    peak_speed_ratio=[],
    limit_violations=0,
    demand_cost=0.0,
    peak_contact_force_n=None,
    binding_limit=None,
    saturated_ticks=0,
    range_excess_rad=0.0,
    certificate={"outcome": "feasible", "binding_limit": "torque:j2", "margin": 0.2},
)


def _row(mine: str, best: str, *, sampled: bool = False, verdict: str = "feasible") -> Row:
    """Return a throw of which the map made one thing and the clairvoyant another."""
    trial = replace(PLAIN, status=mine, certificate={"outcome": verdict})
    return judged(lambda _: trial, lambda _: replace(PLAIN, status=best), 3, sampled=sampled)


def test_the_clairvoyant_runs_what_is_lost_or_sampled() -> None:
    """A caught throw out of the sample costs no plan; any other is run by both."""
    assert _row("caught", "caught")["clairvoyant"] is None
    assert _row("caught", "missed", sampled=True)["clairvoyant"] == "missed"
    assert _row("dropped", "caught")["clairvoyant"] == "caught"


def test_every_failure_is_of_one_kind() -> None:
    """A promise that is not kept and a refusal of what can be caught are told apart."""
    rows = [
        *(_row("caught", "caught") for _ in range(6)),
        _row("dropped", "caught"),
        _row("dropped", "missed"),
        _row("unreachable", "caught", verdict="unreachable"),
        _row("unreachable", "unreachable", verdict="unreachable"),
    ]
    found = counted(rows)
    assert found["throws"] == 10
    assert found["catchable"] == 8
    assert found["caught_of_catchable"]["rate"] == pytest.approx(6 / 8)
    assert (found["false_feasible"]["count"], found["false_feasible"]["of"]) == (2, 8)
    assert (found["false_unreachable"]["count"], found["false_unreachable"]["of"]) == (1, 10)
    assert len(found["failures"]) == 4


def test_a_ball_that_springs_back_breaks_no_promise() -> None:
    """One that was met within 30 mm and within all limits is let go; any other is not."""
    fair = replace(PLAIN, status="dropped", position_error_mm=2.0, velocity_error_m_s=4.0)
    others = [
        replace(fair, position_error_mm=40.0),
        replace(fair, limit_violations=1),
        replace(fair, status="stopped"),
    ]
    trials = [fair, *others]
    rows = [judged(lambda k: trials[k], lambda _: PLAIN, k, sampled=False) for k in range(4)]
    found = counted(rows)
    assert (found["let_go"], found["let_go_at_m_s"]) == (1, 4.0)
    assert found["false_feasible"]["count"] == len(others)
    assert found["false"]["count"] == len(others)
    spared = judged(lambda _: fair, lambda _: PLAIN, 0, sampled=False, thrifty=True)
    assert spared["clairvoyant"] is None


def test_a_catch_beyond_a_limit_is_a_broken_promise() -> None:
    """A promised catch with one violating tick is false feasible, and proves nothing catchable."""
    beyond = replace(PLAIN, limit_violations=1)
    kept = judged(lambda _: PLAIN, lambda _: PLAIN, 0, sampled=False)
    broken = judged(lambda _: beyond, lambda _: PLAIN, 1, sampled=False)
    assert counted([kept, broken])["false_feasible"]["count"] == 1
    refused = replace(PLAIN, status="unreachable", certificate={"outcome": "unreachable"})
    row = judged(lambda _: refused, lambda _: beyond, 2, sampled=False)
    assert counted([row])["false_unreachable"]["count"] == 0


def test_few_answers_of_the_clairvoyant_stand_for_all_refusals() -> None:
    """Half of four refusals that were asked about can be caught: so half of all eight."""
    refused = replace(PLAIN, status="unreachable", certificate={"outcome": "unreachable"})
    asked = [_row("unreachable", best, verdict="unreachable") for best in ("caught", "missed") * 2]
    others = [
        judged(lambda _: refused, lambda _: PLAIN, k, sampled=False, oracle=False) for k in range(4)
    ]
    found = counted(asked + others)
    assert (found["refused"], found["refused_and_asked"]) == (8, 4)
    assert found["false_unreachable"]["count"] == 4


def test_conditions_stand_for_themselves() -> None:
    """One answer about one refusal says nothing of nine refusals of another condition."""
    refused = replace(PLAIN, status="unreachable", certificate={"outcome": "unreachable"})
    hard, easy = refused, replace(PLAIN, status="caught")
    alone = judged(lambda _: refused, lambda _: easy, 0, sampled=False) | {"condition": "a"}
    others = [
        judged(lambda _: refused, lambda _: hard, k, sampled=False, oracle=k < 2)
        | {"condition": "b"}
        for k in range(9)
    ]
    assert counted([alone, *others])["false_unreachable"]["count"] == 1


def test_the_sample_stands_for_all_that_is_caught() -> None:
    """Where the clairvoyant fails on half of the sample, half of the caught count as catchable."""
    rows = [_row("caught", "caught", sampled=True), _row("caught", "dropped", sampled=True)]
    found = counted(rows * 10 + [_row("dropped", "caught")] * 10)
    assert found["catchable"] == 20
    assert found["caught_of_catchable"]["rate"] == pytest.approx(0.5)
    assert found["caught_of_what_either_catches"]["rate"] == pytest.approx(20 / 30)


def test_the_sample_is_the_same_every_time() -> None:
    """It depends on seed and index alone, and is about as large as asked for."""
    drawn = [is_sampled(5, k, 0.2) for k in range(1000)]
    assert drawn == [is_sampled(5, k, 0.2) for k in range(1000)]
    assert 150 < sum(drawn) < 250


def _drawn(rng: np.random.Generator, n: int, refused: float, catchable: float, ask: int) -> Row:
    """Return what a drawn table comes to, whose oracle is asked about few refused throws."""
    rows: list[Row] = []
    for k in range(n):
        status = "unreachable" if rng.random() < refused else "caught"
        best = "caught" if status == "caught" or rng.random() < catchable else "missed"
        asked = status == "unreachable" and ask > 0
        ask -= asked
        rows.append(
            {
                "index": k,
                "status": status,
                "verdict": "unreachable",
                "binding_limit": None,
                "violations": 0,
                "position_error_mm": None,
                "velocity_error_m_s": None,
                "clairvoyant": best if asked else None,
                "clairvoyant_violations": 0,
            }
        )
    return counted(rows)


@pytest.mark.parametrize(
    ("n", "refused", "catchable", "ask"),
    [(100, 0.4, 0.25, 10), (1000, 0.3, 0.1, 10), (200, 0.4, 0.25, 200), (100, 0.5, 0.5, 25)],
)
def test_an_interval_covers_the_truth_however_few_were_asked_about(
    n: int, refused: float, catchable: float, ask: int
) -> None:
    """Of drawn tables, nearly all intervals hold the rate that the tables are drawn with."""
    rng, timid, ratio, draws = np.random.default_rng(4), 0, 0, 150
    truth = refused * catchable
    for _ in range(draws):
        found = _drawn(rng, n, refused, catchable, ask)
        rate, either = found["false_unreachable"], found["caught_of_what_either_catches"]
        timid += rate["low"] <= truth <= rate["high"]
        whole = (1.0 - refused) / (1.0 - refused + truth)
        ratio += either["low"] <= whole <= either["high"]
    assert timid > 0.88 * draws
    assert ratio > 0.88 * draws


def test_none_asked_about_is_not_known_and_one_of_a_hundred_says_little() -> None:
    """No answer leaves everything open up to what was refused; both counts are told."""
    rng = np.random.default_rng(1)
    none, few = (_drawn(rng, 1000, 0.3, 0.1, ask) for ask in (0, 3))
    assert none["false_unreachable"]["low"] == 0.0
    assert none["false_unreachable"]["high"] > none["refused"] / 1000
    assert few["false_unreachable"]["high"] > 0.15
    assert (few["refused_and_asked"], none["refused_and_asked"]) == (3, 0)
    assert few["refused_and_caught_by_clairvoyant"] in range(4)


@given(k=st.integers(0, 30), n=st.integers(0, 30))
def test_one_part_alone_keeps_its_interval(k: int, n: int) -> None:
    """What follows from one rate and is that rate has Wilson's interval."""
    part = share(min(k, n), n)
    assert combined(lambda rate: rate, [part]) == pytest.approx(part)
    falls = combined(lambda rate: 1.0 - rate, [part])
    assert falls == pytest.approx((1.0 - part.rate, 1.0 - part.high, 1.0 - part.low))
