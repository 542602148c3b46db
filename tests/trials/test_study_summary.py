"""What a study comes to: every throw counts, and stops are told by their reason."""

import io
from dataclasses import asdict, replace
from pathlib import Path
from typing import Any

import numpy as np
import pyarrow.parquet as pq
import pytest

from mitt.cli.measuring import _rate
from mitt.clock import Stopwatch
from mitt.core.control.health import Reason, State, StoppedBy
from mitt.lab.trials.catch_study import CatchCondition, CatchStudy
from mitt.lab.trials.result import force_words, run_summary
from mitt.lab.trials.score import CATCH, Trial, reason_of, stop_as_json
from mitt.lab.trials.statistics import wilson
from mitt.lab.trials.study import Player
from mitt.lab.trials.study_results import (
    CellResult,
    against,
    cell_result,
    columns_of,
    compared,
    read_part,
    row_of,
    write_rows,
)

#: Columns of a table of throws.
COLUMNS = columns_of(CATCH.trial, CATCH.extra)
STOP = StoppedBy(
    state=State.ABORT,
    reason=Reason.STUCK,
    joint="j2",
    t=0.31,
    q=np.array([0.1, 0.2, 0.3]),
    dq=np.zeros(3),
    q_read=np.array([0.1, np.nan, 0.3]),
    dq_read=np.zeros(3),
    command=np.ones((4, 3)),
    brakes=True,
)


def trial(index: int, status: str, stop: StoppedBy | None = None) -> Trial:
    """Return a throw with a status."""
    return Trial(
        index=index,
        status=status,
        t_catch_s=None,
        position_error_mm=None,
        velocity_error_m_s=None,
        peak_torque_ratio=[0.0],
        peak_speed_ratio=[0.0],
        limit_violations=0,
        demand_cost=0.0,
        peak_contact_force_n=None,
        binding_limit=None,
        saturated_ticks=0,
        range_excess_rad=0.0,
        stopped_by=stop_as_json(stop),
    )


def test_forces_stand_beside_the_rate(tmp_path: Path, study: CatchStudy) -> None:
    """Median and 95th percentile of those that touched; how many were more than is taken."""
    forces = [10.0, 20.0, 30.0, 400.0, None]
    trials = [
        replace(
            trial(k, "caught" if x else "missed"),
            peak_contact_force_n=x,
            over_force=None if x is None else x > 240.0,
        )
        for k, x in enumerate(forces)
    ]
    row = cell("direct", study.conditions[0], 5, trials, tmp_path).row
    assert (row["catch_rate"], row["over_force"]) == (0.8, 1)
    assert row["force_n"] == {"median": 25.0, "p95": pytest.approx(344.5)}
    assert _rate(CATCH, row) == "80.0, 25!"
    mine = run_summary(CATCH, trials, Stopwatch())
    assert (mine["force_n"], mine["over_force"]) == (row["force_n"], 1)
    assert force_words(mine["force_n"], 1) == (
        "contact force 25 N median, 95 % 344 N, 1 beyond what hand or arm take"
    )
    none = cell("direct", study.conditions[0], 1, [trial(0, "missed")], tmp_path).row
    assert (none["force_n"], _rate(CATCH, none)) == (None, "0.0, -")
    assert force_words(None, 0) == "no ball touched the hand"


def rows_of(generator: str, trials: list[Trial]) -> list[dict[str, Any]]:
    """Return throws as rows of the table."""
    more = dict.fromkeys(CATCH.extra, 1.0)
    return [row_of((generator, "clean"), asdict(x) | more, COLUMNS) for x in trials]


def cell(
    generator: str, condition: CatchCondition, wanted: int, trials: list[Trial], folder: Path
) -> CellResult:
    """Return the throws of a cell, of which there should be ``wanted``."""
    path = folder / f"{generator}.parquet"
    path.write_bytes(write_rows(rows_of(generator, trials), {}, COLUMNS))
    condition = condition.model_copy(update={"counts": {generator: wanted}})
    return cell_result(CATCH, Player(generator), condition, read_part(path, COLUMNS)[0])


def test_a_stop_is_json_with_null_for_what_an_encoder_did_not_say() -> None:
    """State, reason, joint, time, and what was believed, read and commanded."""
    found = stop_as_json(STOP)
    assert found is not None
    assert (found["state"], found["reason"], found["joint"]) == ("abort", STOP.reason.value, "j2")
    assert found["t_s"] == 0.31
    assert found["q_read"] == [0.1, None, 0.3]
    assert found["command_tau"] == [1.0, 1.0, 1.0]
    assert reason_of(found) == f"{STOP.reason.value} j2"
    assert (stop_as_json(None), reason_of(None)) == (None, "")


def test_a_stop_comes_back_from_the_table(tmp_path: Path) -> None:
    """Each part of it is a column; throws that did not stop have none."""
    trials = [trial(0, "stopped", STOP), trial(1, "caught")]
    path = tmp_path / "part.parquet"
    path.write_bytes(write_rows(rows_of("direct", trials), {"digest": "x"}, COLUMNS))
    stopped, caught = read_part(path, COLUMNS)[0]
    wanted = stop_as_json(STOP)
    assert wanted is not None
    assert {name: stopped[f"stopped_by_{name}"] for name in wanted} == wanted
    assert all(caught[f"stopped_by_{name}"] is None for name in wanted)


def test_every_throw_counts_in_rates_and_pairs(tmp_path: Path, study: CatchStudy) -> None:
    """A throw that was stopped or diverged is not caught, for one generator and beside another."""
    statuses = {
        "direct": ["caught", "stopped", "aborted", "missed"],
        "unoptimised": ["caught", "caught", "caught", "dropped"],
    }
    cells = []
    for generator, names in statuses.items():
        trials = [trial(k, x, STOP if x == "stopped" else None) for k, x in enumerate(names)]
        cells += [cell(generator, c, 4, trials, tmp_path) for c in study.conditions]
    first, *_, last = compared(CATCH, cells)
    assert (first["throws"], first["caught"], first["catch_rate"]) == (4, 1, 0.25)
    assert first["ci95"] == list(wilson(1, 4))
    assert (first["stopped"], first["aborted"]) == (1, 1)
    assert first["stopped_by"] == {f"{STOP.reason.value} j2": 1}
    assert last["against_direct"]["pairs"] == 4
    assert (last["against_direct"]["only_direct"], last["against_direct"]["only_this"]) == (0, 2)
    assert last["stopped_by"] == {}


def test_a_part_of_another_version_is_told_by_its_columns() -> None:
    """The table says what a throw was stopped by, so a part without that is an old one."""
    part = write_rows(rows_of("direct", [trial(0, "caught")]), {}, COLUMNS)
    assert "stopped_by_reason" in pq.read_schema(io.BytesIO(part)).names


def test_what_a_generator_takes_is_compared_on_the_balls_that_both_caught(
    tmp_path: Path, study: CatchStudy
) -> None:
    """As a ratio of geometric means: balls that one of them missed say nothing of it."""
    cells = []
    for generator, factor in (("direct", 1.0), ("unoptimised", 2.0)):
        trials = [
            replace(
                trial(k, "missed" if k == 3 and factor == 2.0 else "caught"),
                effort_s=factor * (1.0 + k) * (100.0 if k == 3 else 1.0),
            )
            for k in range(4)
        ]
        cells += [cell(generator, c, 4, trials, tmp_path) for c in study.conditions[:1]]
    _, last = compared(CATCH, cells)
    assert last["against_direct"]["ratio"]["effort_s"] == pytest.approx([2.0, 2.0, 2.0])
    assert "position_error_mm" not in last["against_direct"]["ratio"]


def test_one_correction_holds_for_the_whole_table() -> None:
    """Every cell beside the map's counts, whatever its generator."""
    caught = {("direct", c): dict.fromkeys(range(12), True) for c in "ab"}
    for name in ("x", "y"):
        caught |= {(name, c): dict.fromkeys(range(12), False) for c in "ab"}
    pairs = against(caught, "direct")
    assert [pair["p_holm"] for pair in pairs.values()] == [
        pytest.approx(4.0 * pair["p"]) for pair in pairs.values()
    ]
