"""The search: same seed, same design; the contract holds; the file gives the design back."""

import json
import re
import shlex
from collections.abc import Iterator
from concurrent.futures import BrokenExecutor
from dataclasses import asdict, replace
from itertools import pairwise
from pathlib import Path

import numpy as np
import pytest
from design.conftest import TINY, silent

from mitt.cli import designing as command
from mitt.cli.main import main
from mitt.core.arm.arm import Arm, difference, identity_of
from mitt.core.arm.basket import Basket
from mitt.core.errors import InputError
from mitt.core.map.mapping import unlearned
from mitt.core.map.neighbourhood import Neighbourhood
from mitt.io.arm_file import ArmFile, design_of, hand_of, load_arm, read_arm_file, write_arm_file
from mitt.lab.design import arm_design, evaluation, search_jobs
from mitt.lab.design import search as search_module
from mitt.lab.design.arm_design import (
    AtSpeed,
    Design,
    Fastest,
    design,
    rate_in_words,
    release_speed,
    softer,
    task_at,
)
from mitt.lab.design.candidate import Candidate, candidate_of, mutated
from mitt.lab.design.driven_arm import movable, whole_arm
from mitt.lab.design.evaluation import (
    BEYOND,
    FORCE,
    Evaluation,
    Verdicts,
    cause_of,
    learned_map,
    thrown,
    trials_of,
)
from mitt.lab.design.geometry import drawn, triples_of
from mitt.lab.design.poses import Touch
from mitt.lab.design.search import EFFORTS, best_by_price, effort_of, ranked, search, surely
from mitt.lab.design.search_jobs import Asked, Evaluator, Procedure, SearchJob
from mitt.lab.design.task import BOX, FAR, REPORTED, Balls, DesignTask, shifted
from mitt.lab.report.design_page import advice_of
from mitt.lab.trials.workers import Processes
from mitt.lab.world.scene import read_scene
from mitt.lab.world.throws import Aim, ThrowRanges, default_throw, fly

KEYS = {
    "schema",
    "version",
    "arm",
    "found",
    "reason",
    "joints",
    "throws",
    "feasible",
    "caught",
    "relative_speed_m_s",
    "force_n",
    "force_limit_n",
    "over_force",
    "fastest_m_s",
    "by_speed",
    "seconds",
}


def test_what_is_printed_keeps_the_contract(found: Design) -> None:
    said = found.as_json()
    assert set(said) == KEYS
    assert said["schema"] == "mitt.design/1"
    assert json.loads(json.dumps(said, allow_nan=False)) == said
    assert said["found"] or said["reason"] is not None
    feasible, throws = said["feasible"], said["throws"]
    assert isinstance(feasible, int)
    assert isinstance(throws, int)
    assert 0 <= feasible <= throws
    assert (said["relative_speed_m_s"] is not None) == said["found"]
    rows = said["by_speed"]
    assert isinstance(rows, list)
    for row in rows:
        assert set(row) == {"speed_m_s", "throws", "feasible", "binding_limit", "force_n"}


def test_an_arm_file_gives_the_design_back(found: Design, whole: Arm, tmp_path: Path) -> None:
    best = found.best
    assert best is not None
    path = tmp_path / "design.toml"
    write_arm_file(path, found.arm_file(ArmFile(arm="wam", limits="wam-80v")))
    arm = load_arm(path)
    mine = best.candidate.arm(whole)
    assert difference(identity_of(mine), identity_of(arm)) is None
    assert arm.model.design == best.candidate.design
    assert arm.model.aim is not None
    np.testing.assert_allclose(arm.model.aim, best.candidate.aim, atol=1e-12)


@pytest.mark.parametrize("name", ["xarm7", "ur10e", "franka-fr3"])
def test_the_design_of_a_file_is_the_candidate_that_it_came_from(name: str) -> None:
    """Of five joints as of six: pose, map and box; its joints held where they were."""
    file = design_of(name)
    assert file is not None
    assert file.map is not None
    whole = whole_arm(
        name, tip=None, limits=None, hand=hand_of(file.hand, 0.0, None, file.hand_depth)
    )
    c = candidate_of(whole, file)
    mine, shipped = c.arm(whole), file.load()
    assert difference(identity_of(mine), identity_of(shipped)) is None
    for x, y in zip(asdict(c.design).values(), asdict(file.map).values(), strict=True):
        np.testing.assert_allclose(x, y, atol=1e-12)
    assert shipped.model.aim is not None
    np.testing.assert_array_equal(c.aim, shipped.model.aim)


@pytest.mark.parametrize("best", [1.0, 0.0])
def test_a_design_is_refined_by_throws_in_images_and_never_made_worse(
    found: Design, whole: Arm, task: DesignTask, monkeypatch: pytest.MonkeyPatch, best: float
) -> None:
    """Where the share that is caught falls with the distance from some ready pose of joint 1.

    It is that of the design itself, or one that is 0.3 rad off.
    """
    assert found.best is not None
    start, asked = found.best.candidate, list[tuple[str, SearchJob]]()

    def share(c: Candidate) -> float:
        return float(1.0 / (1.0 + abs(c.ready[0] - start.ready[0] - 0.3 * best)))

    def worth(_: Evaluator, name: str, jobs: list[SearchJob]) -> list[Evaluation]:
        asked.extend((name, job) for job in jobs)
        return [
            Evaluation(
                candidate=x.candidate,
                able=share(x.candidate),
                speed=3.0,
                thrown=1000 * x.by.throws,
                caught=round(1e3 * x.by.throws * share(x.candidate)),
                clean=round(1e3 * x.by.throws * share(x.candidate)),
            )
            for x in jobs
        ]

    monkeypatch.setattr(Evaluator, "_worth", worth)
    evaluator = Evaluator(whole, task, None, silent)
    refined = search(evaluator, EFFORTS["refine"], rate=1.0, start=start)
    assert share(refined[0].candidate) > share(start) + 0.05 * best - 1e-12
    assert all(job.by.images for _, job in asked if job.by.throws)
    assert not any("geometry" in name or "paper" in name for name, _ in asked)


def test_an_arm_without_a_design_cannot_be_refined(
    tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    """Neither a WAM, whose design follows from its limits, nor a file without a box."""
    write_arm_file(tmp_path / "bare.toml", ArmFile(arm="ur5e", hand="basket", hand_mount="plate"))
    out = str(tmp_path / "x.toml")
    for arm in ("wam", str(tmp_path / "bare.toml")):
        assert main(["design", arm, "--effort", "refine", "--out", out, "--check"]) == 2
        assert "wanted an arm with a design" in capsys.readouterr().err
    assert main(["design", "ur5e", "--effort", "refine", "--out", out, "--check"]) == 0


def test_throws_are_aimed_where_the_design_wants_them(
    found: Design, whole: Arm, task: DesignTask
) -> None:
    best = found.best
    assert best is not None
    f = learned_map(whole, best.candidate, task)
    assert f is not None
    trials = trials_of(f, task, throws=2, seed=70)
    assert [trial.index for trial in trials] == [0, 1]
    assert trials == trials_of(f, task, throws=2, seed=70)
    assert trials[:1] != trials_of(f, task, throws=1, seed=70, images=True)


def test_small_changes_stay_in_the_ranges_and_keep_the_aim_near_the_hand(
    found: Design, whole: Arm
) -> None:
    assert found.best is not None
    c = found.best.candidate
    for k in range(50):
        changed = mutated(whole, c, np.random.default_rng(k), size=1.0, moves=True)
        assert np.all((changed.q >= whole.q_min) & (changed.q <= whole.q_max))
        moved = whole.position(changed.q) - whole.position(c.q)
        assert np.linalg.norm(changed.aim[0] - c.aim[0] - moved) < 0.5
        np.testing.assert_array_equal(changed.aim[1], c.aim[1])
        assert changed.kappa >= 1.0
        still = mutated(whole, c, np.random.default_rng(k), size=1.0, moves=False)
        np.testing.assert_array_equal(still.aim, c.aim)


@pytest.mark.thorough
@pytest.mark.parametrize("speed", [2.0, 3.0, 5.0, 6.05, 9.0])
def test_throws_of_one_speed_leave_and_arrive_as_is_said(task: DesignTask, speed: float) -> None:
    at = task_at(task, speed)
    assert at.ranges is not None
    assert release_speed(at) == pytest.approx(speed)
    rng, place = np.random.default_rng(5), np.array([0.77, 0.0, 0.057])
    half = FAR * np.array(BOX)
    aim = Aim(position=np.copy, q_low=place - half, q_high=place + half)
    speeds, descents = [], []
    for _ in range(400):
        throw = default_throw(rng, aim, at.ranges)
        r, v = throw.r, throw.dr
        while r[0] > place[0]:
            r, v = fly(r, v, drag=at.ranges.drag, duration=0.002)
        speeds.append(np.linalg.norm(v))
        descents.append(np.arcsin(-v[2] / np.linalg.norm(v)))
    for seen, (least, most) in ((speeds, at.balls.speeds), (descents, at.balls.descents)):
        assert np.mean((np.array(seen) > least) & (np.array(seen) < most)) > 0.8
    assert at.balls.speeds[0] < at.balls.speed < at.balls.speeds[1]


def test_slow_throws_go_with_the_height_of_the_aim(found: Design, whole: Arm) -> None:
    assert found.best is not None
    arm = found.best.candidate.arm(whole)
    ranges = replace(ThrowRanges(), height=(0.1, 1.2))
    assert arm.model.aim is not None
    by = arm.model.aim[0, 2] - 0.0566
    np.testing.assert_allclose(shifted(ranges, arm).height, (0.1 + by, 1.2 + by))


def test_a_map_is_learned_on_the_balls_that_are_thrown(
    found: Design, whole: Arm, task: DesignTask
) -> None:
    assert found.best is not None
    c, at = found.best.candidate, task_at(task, 4.0)
    start = unlearned(c.arm(whole, at.arrivals), c.design)
    settings = Neighbourhood(flights=20, kicked=0.0, bounced=0.0)
    flights = at.flights(start, np.random.default_rng(3), settings)
    assert flights
    for flight in flights:
        speed = np.linalg.norm(flight.ball[-1, 1])
        assert at.balls.speeds[0] - 1.0 < speed < at.balls.speeds[1] + 1.0
        assert flight.t[-1] > flight.t[0] + 0.2


@pytest.mark.parametrize(
    ("words", "wanted"),
    [
        (["nobody.urdf", "--tip", "hand"], "nobody.urdf"),
        (["robot.txt"], "robot.txt"),
        (["wam", "--joints", "j1,j2"], "--joints"),
        (["wam", "--joints", "j1,j2,j9"], "j9"),
        (["wam", "--limits", "nothing"], "nothing"),
        (["wam", "--aim", "1,2"], "--aim"),
        (["wam", "--aim", "nan,0,0"], "--aim"),
        (["wam", "--seed", "-1"], "--seed"),
        (["wam", "--tip", "hand"], "tip"),
    ],
)
def test_bad_input_is_one_line(
    words: list[str], wanted: str, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    assert main(["design", *words, "--out", str(tmp_path / "d.toml"), "--check"]) == 2
    said = capsys.readouterr().err.strip()
    assert wanted in said
    assert len(said.splitlines()) == 1


def test_an_arm_that_cannot_is_told_so_and_no_file_is_written(
    whole: Arm,
    task: DesignTask,
    tmp_path: Path,
    monkeypatch: pytest.MonkeyPatch,
    capsys: pytest.CaptureFixture[str],
) -> None:
    row = AtSpeed(speed_m_s=3.0, throws=12, feasible=2, binding_limit="speed:j2")
    lost = Design(
        whole=whole,
        task=task,
        found=False,
        reason="too slow",
        best=None,
        fastest=Fastest(speed_m_s=2.5),
        rows=(row,),
    )
    monkeypatch.setattr(command, "search_design", lambda *_, **__: lost)
    out = tmp_path / "d.toml"
    assert main(["design", "wam", "--out", str(out), "--json", "--workers", "1"]) == 0
    said = json.loads(capsys.readouterr().out)
    assert not said["found"]
    assert said["fastest_m_s"] == 2.5
    assert said["by_speed"][0]["binding_limit"] == "speed:j2"
    assert not out.exists()
    assert out.with_suffix(".html").exists()
    again = ["design", "wam", "--out", str(out), "--workers", "1"]
    assert main(again) == 2
    assert "d.html" in capsys.readouterr().err
    out.write_text("# mitt design: stale")
    assert main([*again, "--overwrite"]) == 0
    assert out.read_text() == "# mitt design: stale"
    said_so = capsys.readouterr().out.replace("\n", "")
    assert "stays" in said_so
    assert "written: " in said_so
    assert "d.html" in said_so
    assert "d.toml" not in said_so.partition("written: ")[2]


def test_an_out_of_another_kind_is_refused(
    tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    assert main(["design", "wam", "--out", str(tmp_path / "d.html"), "--check"]) == 2
    assert "ends in .toml" in capsys.readouterr().err


def test_the_arm_file_that_is_given_is_not_written_over(
    tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    path = tmp_path / "arm.toml"
    path.write_text('schema = "mitt.arm/1"\n[arm]\nname = "wam"\n')
    before = path.read_text()
    assert main(["design", str(path), "--out", str(path), "--overwrite", "--check"]) == 2
    assert "another file than the arm's" in capsys.readouterr().err
    assert path.read_text() == before


def test_the_command_that_comes_next_is_said_and_good(
    found: Design,
    tmp_path: Path,
    monkeypatch: pytest.MonkeyPatch,
    capsys: pytest.CaptureFixture[str],
) -> None:
    """It catches with the design that was written, in the scene of the search."""
    monkeypatch.setattr(command, "search_design", lambda *_, **__: found)
    out = str(tmp_path / "a design.toml")
    words = ["design", "wam", "--out", out, "--workers", "1", "--scene", "ideal"]
    assert main(words) == 0
    said = capsys.readouterr().out.splitlines()
    assert said[-1].startswith("next: mitt catch --arm ")
    again = shlex.split(said[-1])[2:]
    assert again == ["catch", "--arm", out, "--scene", "ideal"]
    assert main([*again, "--check", "--out", str(tmp_path / "run")]) == 0


def test_an_arm_file_keeps_its_joints(
    found: Design, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    path, asked = tmp_path / "arm.toml", list[tuple[Arm, list[str]]]()
    file = ArmFile(arm="wam", joints=("j1", "j2", "j4"), held={"j3": 0.1}, limits="wam-80v")
    write_arm_file(path, file)

    def noted(arm: Arm, *_: object, joints: list[str], **__: object) -> Design:
        asked.append((arm, joints))
        return replace(found, found=False, reason="none", best=None, rows=())

    monkeypatch.setattr(command, "search_design", noted)
    out = str(tmp_path / "d.toml")
    assert main(["design", str(path), "--out", out, "--workers", "1"]) == 0
    arm, joints = asked[0]
    assert tuple(joints) == file.joints
    name, angle = next(iter(file.held.items()))
    k = arm.names.index(name)
    assert not movable(arm)[k]
    assert movable(arm).sum() == 3
    assert arm.q_min[k] <= angle <= arm.q_max[k]
    rows = drawn(
        arm,
        Balls(),
        triples_of(arm, joints),
        np.random.default_rng(1),
        count=4000,
        touch=Touch(arm, read_scene("ideal")),
    )
    assert len(rows.q) > 0
    assert np.ptp(rows.q[:, k]) < 2e-3
    again = [*["design", str(path), "--out", out, "--workers", "1"], "--overwrite"]
    assert main([*again, "--joints", "j1,j2,j4"]) == 0
    assert movable(asked[1][0]).all()


def test_an_arm_file_of_another_description_or_without_a_hand_is_refused(
    tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    (tmp_path / "arm.urdf").write_text("<robot/>")
    text = 'schema = "mitt.arm/1"\n[arm]\nfile = "arm.urdf"\ntip = "t"\njoints = ["a", "b", "c"]\n'
    path = tmp_path / "arm.toml"
    for more, wanted in (
        (f'sha256 = "{"0" * 64}"\n', "SHA-256"),
        ('[hand]\nname = "none"\n', "hand"),
    ):
        path.write_text(text + more)
        assert main(["design", str(path), "--out", str(tmp_path / "d.toml"), "--check"]) == 2
        said = capsys.readouterr().err.strip()
        assert wanted in said
        assert len(said.splitlines()) == 1


def test_what_is_reported_was_thrown_with_seeds_that_no_search_uses(
    searched: tuple[Design, list[tuple[str, SearchJob]]],
) -> None:
    found, asked = searched
    names = [name for name, _ in asked]
    last = names.index("reporting")
    thrown = [job for _, job in asked[:last] if job.by.throws]
    assert thrown
    assert all(job.by.seed < REPORTED for job in thrown)
    job, speeds = asked[last][1], [job for name, job in asked if name == "reporting"][1:]
    assert (job.by.seed, job.by.throws, job.by.give_up) == (REPORTED, TINY.report, False)
    assert found.best is not None
    assert found.best.thrown == TINY.report
    assert [release_speed(job.task) for job in speeds] == pytest.approx(TINY.speeds)
    assert [x.throws for x in found.rows] == [TINY.each_speed] * len(TINY.speeds)
    assert set(names[last + 1 :]) <= {"reporting", "speeds", "fastest"}
    assert all(job.by.seed > REPORTED for _, job in asked[last + 1 :])


def test_a_share_is_told_with_its_interval(found: Design) -> None:
    assert rate_in_words(60, 60) == "60 of 60 (95 % interval 94.0 to 100.0 %)"
    assert found.best is not None
    text = command._comment(found, "field")
    assert "scene field" in text
    assert found.rate in text
    assert "95 % interval" in text


def _worth(found: Design, clean: int, speed: float, *, thrown: int = 100) -> Evaluation:
    """Return what a design would be worth."""
    assert found.best is not None
    return replace(found.best, thrown=thrown, caught=clean, clean=clean, speed=speed, force=0.0)


def test_the_softest_of_those_that_catch_enough_is_taken(found: Design) -> None:
    hard, soft, softest = _worth(found, 100, 4.0), _worth(found, 98, 2.0), _worth(found, 90, 1.0)
    pool = [hard, softest, soft]
    assert ranked(pool, 0.98) == [soft, hard, softest]
    assert ranked(pool, 0.9)[0] is softest
    assert ranked([softest, _worth(found, 95, 3.0)], 0.98)[0].clean == 95
    assert ranked([], 0.98) == []


def test_more_throws_at_a_design_are_added_up(found: Design) -> None:
    first, second = _worth(found, 90, 2.0), _worth(found, 30, 4.0, thrown=50)
    both = first.with_more(second)
    assert (both.thrown, both.caught, both.clean) == (150, 120, 120)
    assert both.speed == pytest.approx((90 * 2.0 + 30 * 4.0) / 120)
    none = replace(first, caught=0, clean=0)
    assert none.with_more(none).caught == 0


def test_of_two_maps_beyond_a_limit_the_nearer_one_counts_more() -> None:
    """What is far beyond must still be told from what is farther."""

    def able(share: float, *, speed: float = 0.5, angle: float = 0.0) -> float:
        one = np.ones(4)
        said = Verdicts(
            share=share * one,
            speed=speed * one,
            angle=angle * one,
            place=np.zeros((4, 3)),
            binding=("torque:j2",) * 4,
        )
        return evaluation._able(said)

    counts = [able(share) for share in (0.5, 0.95, 1.2, 3.0, 50.0, np.inf)]
    assert counts[0] == counts[1] == 1.0
    assert all(a > b for a, b in pairwise(counts[1:]))
    assert counts[-1] == 0.0
    assert able(0.5, speed=0.5, angle=1.3) == 1.0  # a slow ball may come in aslant
    assert able(0.5, speed=0.5, angle=1.8) < 0.4  # but not from behind
    assert 0.0 < able(0.5, speed=3.0, angle=1.5) < able(0.5, speed=3.0, angle=0.6) < 1.0


def test_a_map_counts_as_often_as_throws_come_to_it(
    found: Design, whole: Arm, task: DesignTask
) -> None:
    assert found.best is not None
    c = found.best.candidate
    f = learned_map(whole, c, task)
    assert f is not None
    worth = evaluation.judged(c, f, task)
    assert worth.able > 0.0
    middle, away = f.region.mean(axis=0), replace(f, region=f.region + 3.0)
    assert evaluation.judged(c, away, task).able == 0.0
    narrow = replace(f, region=np.array([middle, middle]))
    assert evaluation.judged(c, narrow, task).able <= worth.able


def test_balls_too_fast_for_an_arm_count_as_lost(
    found: Design, whole: Arm, task: DesignTask
) -> None:
    """Balls that a map cannot follow are not drawn anew: no map looks better than it is."""
    assert found.best is not None
    c = found.best.candidate
    f = learned_map(whole, c, task)
    assert f is not None
    fast = replace(task, ranges=task_at(task, 12.0).ranges)
    assert evaluation.judged(c, f, fast).able < 0.5 * evaluation.judged(c, f, task).able


def test_a_search_keeps_what_is_best_for_each_price(found: Design) -> None:
    hard, soft = _worth(found, 100, 5.0), _worth(found, 60, 0.5)
    between, poor = _worth(found, 90, 2.0), _worth(found, 10, 4.0)
    paper = replace(_worth(found, 0, 0.1, thrown=0), able=1.0)
    pool = [poor, paper, soft, between, hard]
    assert best_by_price(pool, 4) == [hard, between, soft, poor]
    assert best_by_price(pool, 9)[4:] == [paper]


def test_balls_caught_beyond_a_limit_do_not_count(found: Design) -> None:
    assert found.best is not None
    over = replace(found.best, thrown=100, caught=100, clean=79)
    assert not over.enough
    assert replace(over, clean=80).enough
    assert not replace(over, thrown=0, caught=0, clean=0).enough
    said = replace(found, best=over).as_json()
    assert (said["throws"], said["feasible"], said["caught"]) == (100, 79, 100)
    row = arm_design._at(6.0, over)
    assert (row.throws, row.feasible) == (100, 79)


def test_a_cause_is_the_limit_only_where_a_throw_was_refused_for_it(
    found: Design, whole: Arm, task: DesignTask
) -> None:
    assert found.best is not None
    f = learned_map(whole, found.best.candidate, task)
    assert f is not None
    one = trials_of(f, task, throws=1, seed=70)[0]
    dropped = replace(one, status="dropped", binding_limit="speed:j2")
    refused = replace(dropped, status="unreachable")
    stopped = replace(dropped, status="stopped", stopped_by={"reason": "encoder", "joint": "j1"})
    caught = replace(dropped, status="caught", limit_violations=0)
    assert cause_of([caught, dropped]) == "dropped"
    assert cause_of([refused, refused, dropped]) == "speed:j2"
    assert cause_of([stopped]) == "stopped: encoder j1"
    assert cause_of([caught, replace(caught, limit_violations=3)]) == BEYOND
    assert cause_of([caught]) == ""
    hard = replace(caught, over_force=True)
    assert cause_of([caught, hard]) == FORCE
    assert cause_of([replace(hard, limit_violations=3)]) == BEYOND


@pytest.mark.thorough
def test_a_design_whose_force_is_too_much_says_so_and_what_helps(
    found: Design, whole: Arm, task: DesignTask, monkeypatch: pytest.MonkeyPatch
) -> None:
    """Caught above what hand or arm take is beyond a limit; a basket is named, if it is none."""
    assert found.best is not None
    best = found.best
    c, weak = best.candidate, Arm(whole.model, replace(whole.limits, force=20.0))
    f = learned_map(whole, c, task)
    assert f is not None
    soft = thrown(c, f, task, throws=2, seed=70)
    frail = replace(f.arm.limits, force=10.0)  # less than a finger presses with
    hard = thrown(c, replace(f, arm=Arm(f.arm.model, frail)), task, throws=2, seed=70)
    assert (soft.caught, soft.hard) == (2, 0)
    assert soft.clean > 0
    assert hard.clean == 0
    assert hard.hard == hard.caught  # 0 where the verdict refuses it before
    assert hard.binding == FORCE
    lost = replace(best, thrown=100, caught=90, clean=10, hard=80, binding=FORCE)
    monkeypatch.setattr(arm_design, "search", lambda *_, **__: [lost])
    monkeypatch.setattr(arm_design, "_described", lambda *_: (lost, tuple(_rows(True))))
    monkeypatch.setattr(arm_design, "slower", lambda *_, **__: None)
    monkeypatch.setattr(arm_design, "fastest", lambda *_, **__: Fastest(speed_m_s=0.0))
    mine = design(weak, task, TINY, progress=silent)
    said = mine.as_json()
    assert (said["found"], said["force_limit_n"], said["over_force"]) == (False, 20.0, 80)
    assert mine.reason is not None
    for words in ("80 of them by their force", "take 20 N", "--hand basket", "slower throws"):
        assert words in mine.reason
    assert any("80 of 100 balls" in line for line in advice_of(mine, [], 0.0))
    net = Arm(replace(weak.model, hand=Basket()), weak.limits)
    assert "--hand basket" not in softer(net)
    assert "slower throws" in softer(net)


def test_an_arm_that_cannot_hold_itself_is_told_so_after_one_search(
    whole: Arm, task: DesignTask
) -> None:
    """As by a file with placeholders for torques: slower throws would need as much."""
    limits, asked = whole.limits, list[str]()
    weak = replace(limits, tau_peak=0.02 * limits.tau_peak, tau_stall=0.02 * limits.tau_stall)

    def heard(name: str, *_: int) -> None:
        asked.append(name)

    mine = design(Arm(whole.model, weak), task, TINY, progress=heard)
    assert (mine.found, mine.best, mine.usable) == (False, None, False)
    assert mine.reason is not None
    assert re.search(r"j\d is too weak to hold the arm.*--limits FILE\.toml", mine.reason)
    assert not [x for x in asked if "slower" in x]


def test_what_catches_nothing_is_not_thrown_at_again(
    found: Design, whole: Arm, task: DesignTask, monkeypatch: pytest.MonkeyPatch
) -> None:
    """By many throws in images; the reason is that of the few throws there were."""
    assert found.best is not None
    c, asked = found.best.candidate, list[str]()
    none = replace(found.best, thrown=4, caught=0, clean=0, hard=0, binding="torque:j2")
    monkeypatch.setattr(search_module, "_sought", lambda *_: [c])
    monkeypatch.setattr(search_jobs, "hindrance", lambda *_: "")
    monkeypatch.setattr(search_jobs, "learned_map", lambda *_: object())
    monkeypatch.setattr(search_jobs, "judged", lambda c, *_: replace(none, candidate=c, thrown=0))
    monkeypatch.setattr(search_jobs, "thrown", lambda c, *_, **__: replace(none, candidate=c))
    monkeypatch.setattr(arm_design, "slower", lambda *_, **__: None)

    def heard(name: str, *_: int) -> None:
        asked.append(name)

    mine = design(whole, task, TINY, progress=heard)
    assert mine.reason is not None
    assert "caught 0 of 4 throws within every limit; most were lost by: torque:j2" in mine.reason
    assert [x for x in asked if "throwing" in x]
    assert not [x for x in asked if "confirming" in x or "reporting" in x]


def test_what_was_not_thrown_at_has_no_throws_and_says_why(
    found: Design, whole: Arm, task: DesignTask, monkeypatch: pytest.MonkeyPatch
) -> None:
    assert found.best is not None
    c, bench = found.best.candidate, Evaluator(whole, task, None, silent)
    monkeypatch.setattr(search_jobs, "learned_map", lambda *_: None)
    row = arm_design.by_speed(bench, c, task, [5.0], throws=2)[0]
    assert (row.throws, row.feasible) == (0, 0)
    assert row.binding_limit in ("no pose", "no map")
    assert bench.tally.told() == []


def test_an_error_of_one_candidate_is_counted_and_ends_nothing(
    found: Design, whole: Arm, task: DesignTask, monkeypatch: pytest.MonkeyPatch
) -> None:
    assert found.best is not None
    c, bench = found.best.candidate, Evaluator(whole, task, None, silent)

    def broken(*_: object, **__: object) -> str:
        raise InputError("throw", "a throw", "none")

    monkeypatch.setattr(search_jobs, "hindrance", broken)
    assert bench.try_all("some", [c, c], Procedure(throws=1, seed=1)) == []
    assert (bench.tally.errors, bench.tally.lost) == (2, 0)
    assert bench.tally.told() == [
        "left out for an error: 2 candidates; the first: throw: wanted a throw, got none"
    ]


def _rows(*good: bool) -> list[AtSpeed]:
    return [
        AtSpeed(speed_m_s=3.0 + k, throws=12, feasible=12 if x else 3, binding_limit=None)
        for k, x in enumerate(good)
    ]


@pytest.mark.thorough
def test_the_fastest_throws_are_the_last_before_the_first_failure(
    found: Design, whole: Arm, task: DesignTask, monkeypatch: pytest.MonkeyPatch
) -> None:
    assert found.best is not None
    best, bench = found.best, Evaluator(whole, task, None, silent)
    limit, thrown_at = 5.3, list[tuple[float, int, int]]()

    def each(_: str, asked: list[Asked]) -> list[Evaluation]:
        out = []
        for _c, at, by in asked:
            thrown_at.append((release_speed(at), by.throws, by.seed))
            good = by.throws if release_speed(at) < limit else 0
            out.append(replace(best, thrown=by.throws, caught=good, clean=good))
        return out

    monkeypatch.setattr(Evaluator, "try_each", lambda _, *a: each(*a))

    def of(rows: list[AtSpeed], own: float) -> Fastest:
        return arm_design.fastest(bench, best.candidate, task, rows, TINY, own=own)

    # A lucky row beyond the first failure does not count.
    mine = of(_rows(True, True, True, False, True), 4.0)
    assert 5.0 <= mine.speed_m_s < limit
    assert not mine.more
    halves = [(TINY.sure // 2, arm_design._SURE_SEED + k) for k in range(2)]
    assert [x[1:] for x in thrown_at[-2:]] == halves
    assert arm_design._SURE_SEED > arm_design._SPEEDS_SEED > REPORTED
    # Rows that were luck are taken back by fresh throws.
    assert of(_rows(True, True, True, True, True), 3.0).speed_m_s == 5.0
    limit = 99.0
    most = of(_rows(True, True, True), 3.0)
    assert str(most) == "at least 5.0 m/s"
    assert str(of(_rows(False, False), 0.0)) == "none"


@pytest.mark.thorough
def test_a_design_for_slower_throws_only_is_the_one_described(
    found: Design, whole: Arm, task: DesignTask, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    assert found.best is not None
    at = task_at(task, 3.0)
    usual = replace(found.best, thrown=100, caught=20, clean=10, binding="speed:j2")
    slow = replace(usual, candidate=replace(usual.candidate, turn=0.5), caught=90, clean=90)
    monkeypatch.setattr(arm_design, "search", lambda *_, **__: [usual])
    monkeypatch.setattr(arm_design, "_described", lambda *_: (usual, tuple(_rows(False))))
    monkeypatch.setattr(arm_design, "slower", lambda *_, **__: (slow, at))
    monkeypatch.setattr(arm_design, "by_speed", lambda *_, **__: _rows(True))
    monkeypatch.setattr(arm_design, "fastest", lambda *_, **__: Fastest(speed_m_s=3.0))
    mine = design(whole, task, TINY, progress=silent)
    said = mine.as_json()
    assert not mine.found
    assert mine.usable
    assert mine.best is slow
    assert list(mine.rows) == _rows(True)
    assert (said["found"], said["throws"], said["feasible"]) == (False, 100, 90)
    assert mine.reason is not None
    assert "10 of 100 throws" in mine.reason
    assert "3.0 m/s" in mine.reason
    path = tmp_path / "slow.toml"
    write_arm_file(path, mine.arm_file(ArmFile(arm="wam", limits="wam-80v")), comment="x")
    throws, arrivals = read_arm_file(path).throws, read_arm_file(path).arrivals
    assert arrivals is not None
    assert 1.5 < arrivals.speed[0] < 3.0 < arrivals.speed[1] < 5.0
    assert throws is not None
    assert throws.speed == pytest.approx((2.85, 3.15))
    assert throws.height is not None
    assert "slower throws, leaving at 3.0 m/s" in command._comment(mine, "lab")


def test_candidates_of_a_dead_worker_are_evaluated_by_themselves(
    found: Design, whole: Arm, task: DesignTask, monkeypatch: pytest.MonkeyPatch
) -> None:
    """The worker of candidate 1 always dies, and takes with it what is under way."""
    assert found.best is not None
    c, windows = found.best.candidate, list[int]()

    def run(
        _: object, __: object, trials: list[SearchJob], *, window: int
    ) -> Iterator[tuple[SearchJob, bytes | BaseException]]:
        windows.append(window)
        bad = any(trial.number == 1 for trial in trials)
        plain = b'{"able": 0.5, "speed": 1.0}'
        for trial in trials:
            yield trial, BrokenExecutor() if bad else plain

    monkeypatch.setattr(search_jobs, "run_tasks", run)
    engine = Processes(2)
    bench = Evaluator(whole, task, engine, silent)
    worth = bench.try_all("some", [c, c, c], Procedure())
    engine.close(at_once=True)
    assert [w.able for w in worth] == [0.5, 0.5]
    assert windows[0] == 4
    assert set(windows[1:]) == {1}
    assert bench.tally.lost == 1
    assert "1 candidates" in bench.tally.told()[0]


def test_the_effort_in_full_goes_with_the_number_of_joints() -> None:
    full, half, many = EFFORTS["full"], effort_of("full", 3), effort_of("full", 7)
    assert many == effort_of("full", 5) == replace(full, throws=full.throws[:-1])
    assert effort_of("full", 4) == replace(full, weights=(1.0,))
    assert effort_of("quick", 3) == effort_of("quick", 7)
    for name in ("judged", "offspring", "thrown", "parents", "children"):
        assert getattr(half, name) == (getattr(full, name) + 1) // 2
    assert (half.last, half.again) == (full.last // 2, full.again // 2)
    assert half.throws == full.throws[:-2]
    assert (half.confirm, half.report) == (full.confirm, full.report)


def test_no_more_is_tried_on_paper_than_is_learned(
    whole: Arm, task: DesignTask, monkeypatch: pytest.MonkeyPatch
) -> None:
    """The first that are sound, in their order, as if all had been tried."""
    asked = list[Candidate]()

    def worth(_: Evaluator, __: str, jobs: list[SearchJob]) -> list[Evaluation]:
        asked.extend(job.candidate for job in jobs)
        why = ["", "no pose", "", ""]
        return [
            Evaluation(candidate=job.candidate, able=1.0, speed=0.0, failed=why[job.number % 4])
            for job in jobs
        ]

    monkeypatch.setattr(Evaluator, "_worth", worth)
    effort = replace(TINY, judged=4)
    sought = search_module._sought(Evaluator(whole, task, None, silent), effort, None)
    assert len(asked) == 12
    assert sought == [c for k, c in enumerate(asked) if k % 4 != 1][:8]


@pytest.mark.parametrize(
    ("lost", "tried"), [((0, 9, 9, 9), 2), ((9, 9, 0, 0), 4), ((9, 9, 9, 8), 4)]
)
def test_the_last_are_thrown_at_until_the_softest_that_catches_enough_is_known(
    found: Design,
    whole: Arm,
    task: DesignTask,
    monkeypatch: pytest.MonkeyPatch,
    lost: tuple[int, ...],
    tried: int,
) -> None:
    """Of four, the harder the later: no pair after one that has what is asked for."""
    assert found.best is not None
    c, further = found.best.candidate, list[int]()
    last = [replace(c, turn=0.1 * k, match_weight=0.0) for k in (2, 0, 3, 1)]

    def worth(_: Evaluator, name: str, jobs: list[SearchJob]) -> list[Evaluation]:
        out, again = [], name.startswith("confirming again")
        for job in jobs:
            rank, n = round(job.candidate.turn / 0.1), job.by.throws
            clean = n - lost[rank] if again else n
            out.append(
                Evaluation(
                    candidate=job.candidate,
                    able=1.0,
                    speed=1.0 + rank,
                    thrown=n,
                    caught=clean,
                    clean=clean,
                )
            )
            further.extend([rank] if again else [])
        return out

    monkeypatch.setattr(Evaluator, "_worth", worth)
    effort, evaluator = EFFORTS["full"], Evaluator(whole, task, None, silent)
    best = search_module._confirmed(evaluator, effort, last, 0.98)
    assert further == list(range(tried))
    assert round(best[0].candidate.turn / 0.1) == int(np.argmin(lost))
    assert best[0].thrown == effort.confirm + effort.more


def test_more_is_asked_for_than_the_rate_the_fewer_throws_there_are() -> None:
    assert surely(0.98, 200) * 200 == pytest.approx(198.0, abs=0.1)
    assert surely(0.98, 10**9) == pytest.approx(0.98, abs=1e-4)
    assert surely(1.0, 10) == surely(0.99, 5) == 1.0
