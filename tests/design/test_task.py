"""How balls arrive: measured on default throws, a user's throws and recorded flights."""

from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

from mitt.cli.designing import _task
from mitt.cli.main import main
from mitt.cli.options import DesignOptions
from mitt.core.arm.arm import Arm
from mitt.core.errors import FileError, InputError
from mitt.core.map.mapping import unlearned
from mitt.core.map.neighbourhood import Neighbourhood
from mitt.io.arm_file import ArmFile, load_arm, write_arm_file
from mitt.io.load import build_arm
from mitt.io.schema import to_plain
from mitt.lab.design.arm_design import Design, release_speed, task_at
from mitt.lab.design.task import (
    REPORTED,
    Balls,
    DesignTask,
    box_of,
    of_default_throws,
    of_flights,
    of_throws,
    ranges_of_throws,
    unseen,
)
from mitt.lab.trials.source import aim_of
from mitt.lab.world.flights import builtin_flights
from mitt.lab.world.scene import read_scene
from mitt.lab.world.throws import NOMINAL_DRAG, Aim, Throw, ThrowRanges, default_throw

PLACE = 0.77


@pytest.fixture(scope="module")
def throws() -> tuple[Throw, ...]:
    """Sixty default throws of the WAM."""
    rng, aim = np.random.default_rng(4), aim_of(build_arm("wam"))
    return tuple(default_throw(rng, aim) for _ in range(60))


def _turned(throws: tuple[Throw, ...], angle: float) -> list[Throw]:
    """Return throws from elsewhere: turned about the vertical."""
    c, s = np.cos(angle), np.sin(angle)
    R = np.array([[c, -s, 0.0], [s, c, 0.0], [0.0, 0.0, 1.0]])
    return [Throw(r=R @ x.r, dr=R @ x.dr) for x in throws]


def test_default_throws_arrive_as_the_defaults_say() -> None:
    """What is left out of ``Balls``, and what maps are learned on, fit the throws themselves."""
    arrivals = of_default_throws(ThrowRanges())
    measured, said = arrivals.balls(), Balls()
    assert measured.speed == pytest.approx(said.speed, abs=0.1)
    assert measured.descent == pytest.approx(said.descent, abs=0.05)
    assert measured.speeds == pytest.approx(said.speeds, abs=0.15)
    assert measured.descents == pytest.approx(said.descents, abs=0.05)
    usual = Neighbourhood()
    assert arrivals.ranges() == pytest.approx(
        np.array([usual.arrival, usual.descent, usual.azimuth, usual.flight]), abs=0.2
    )


def test_a_users_throws_are_measured_where_they_pass(throws: tuple[Throw, ...]) -> None:
    box = box_of(throws, NOMINAL_DRAG, None, 0.75)
    assert 0.5 < np.linalg.norm(box[0]) < 0.8
    arrivals = of_throws(throws, float(box[0, 0]), NOMINAL_DRAG)
    assert np.all(arrivals.r[:, 0] <= box[0, 0])
    assert np.all(arrivals.r[:, 0] > box[0, 0] - 0.05)
    inside = np.abs(arrivals.r - box[0])[:, 1:] <= box[1, 1:]
    assert np.mean(inside) > 0.9
    ranges = ranges_of_throws(throws, box, NOMINAL_DRAG)
    for name in ("speed", "duration", "distance"):
        low, high = getattr(ThrowRanges(), name)
        assert 0.8 * low < getattr(ranges, name)[0] < getattr(ranges, name)[1] < 1.15 * high
    aimed = box_of(throws, NOMINAL_DRAG, np.array([0.9, 0.1, 0.2]), 0.75)
    np.testing.assert_array_equal(aimed[0], [0.9, 0.1, 0.2])


def test_throws_from_a_little_aside_are_seen_to(throws: tuple[Throw, ...]) -> None:
    aside = _turned(throws, 0.3)
    box = box_of(aside, NOMINAL_DRAG, None, 0.75)
    balls = of_throws(aside, float(box[0, 0]), NOMINAL_DRAG).balls(aim=box)
    assert balls.azimuth == pytest.approx(0.3, abs=0.05)
    v = balls.velocity()
    assert np.arctan2(-v[1], -v[0]) == pytest.approx(balls.azimuth)
    low, high = of_throws(aside, float(box[0, 0]), NOMINAL_DRAG).ranges()[2]
    assert 0.0 < low < 0.3 < high < 0.6


def test_throws_that_never_come_are_refused(throws: tuple[Throw, ...]) -> None:
    with pytest.raises(InputError, match="turn the frame"):
        box_of(_turned(throws, 2.0), NOMINAL_DRAG, None, 0.75)
    with pytest.raises(InputError, match="throw 0"):
        of_throws(throws, 9.0, NOMINAL_DRAG)
    away = [Throw(r=x.r, dr=x.dr * [-1.0, 1.0, 1.0]) for x in throws]
    with pytest.raises(InputError, match="throw 0"):
        of_throws(away, PLACE, NOMINAL_DRAG)


def test_an_aim_far_from_the_throws_is_refused(throws: tuple[Throw, ...]) -> None:
    with pytest.raises(InputError, match="--aim"):
        box_of(throws, NOMINAL_DRAG, np.array([0.5, -0.6, 0.7]), 0.75)


def test_ranges_of_a_ball_machine_can_be_thrown(throws: tuple[Throw, ...]) -> None:
    """Speed, distance and time are drawn one by one, so they need room."""
    one = [throws[3]]
    box = box_of(one, NOMINAL_DRAG, None, 0.75)
    ranges = ranges_of_throws(one, box, NOMINAL_DRAG)
    aim = Aim(position=np.copy, q_low=box[0] - box[1], q_high=box[0] + box[1])
    thrown = [default_throw(np.random.default_rng(k), aim, ranges) for k in range(20)]
    assert len({float(x.dr[0]) for x in thrown}) == 20


def test_recorded_flights_arrive_as_they_are_led() -> None:
    arrivals = of_flights(builtin_flights())
    assert len(arrivals.t) == 44
    assert np.all(arrivals.v[:, 0] < 0.0)
    np.testing.assert_allclose(arrivals.r, 0.0, atol=1e-9)


def test_a_search_sees_other_throws_than_those_that_are_reported(
    throws: tuple[Throw, ...], task: DesignTask, found: Design, whole: Arm
) -> None:
    assert found.best is not None
    f = unlearned(found.best.candidate.arm(whole), found.best.candidate.design)
    many = replace(task, throws=throws)
    seen, kept = (many.source(f, throws=20, seed=seed).throws for seed in (100, REPORTED))
    assert len(seen) == len(kept) == len(throws) // 2
    assert {id(x) for x in (*seen, *kept)} == {id(x) for x in throws}
    few = replace(task, throws=throws[:10])
    assert few.source(f, throws=20, seed=REPORTED).throws == throws[:10]
    flights = replace(task, recordings=builtin_flights())
    assert len(flights.source(f, throws=20, seed=100).recordings) == 22
    speeds = [np.linalg.norm(x.dr) for x in throws]
    assert min(speeds) < release_speed(many) < max(speeds)
    assert not task_at(many, 4.0).own
    assert (task.unseen, few.unseen, many.unseen, flights.unseen) == (None, 0, 30, 22)
    assert len({x.reported for x in (task, few, many)}) == 3


def test_an_arm_file_says_how_its_balls_arrive(
    found: Design, task: DesignTask, throws: tuple[Throw, ...], tmp_path: Path
) -> None:
    """A map is then learned on such balls, whatever command learns it."""
    box = box_of(throws, NOMINAL_DRAG, None, 0.75)
    arrivals = of_throws(throws, float(box[0, 0]), NOMINAL_DRAG)
    own = replace(task, throws=throws, balls=arrivals.balls(aim=box), arrivals=arrivals.ranges())
    path = tmp_path / "own.toml"
    write_arm_file(path, replace(found, task=own).arm_file(ArmFile(arm="wam", limits="wam-80v")))
    arm = load_arm(path)
    assert arm.model.arrivals is not None
    assert arm.model.arrivals == pytest.approx(arrivals.ranges())
    path.write_text(path.read_text().replace("speed = [", "speed = [40.0, ", 1))
    with pytest.raises(FileError, match=r"own\.toml"):
        load_arm(path)


@pytest.mark.parametrize(
    ("words", "wanted"),
    [
        (["--throws-file", "nothing.csv"], "nothing.csv"),
        (["--flights", "nothing.csv"], "nothing.csv"),
        (["--throws-file", "a.csv", "--flights", "b.csv"], "one of them"),
        (["--rate", "0.5"], "--rate"),
        (["--rate", "nan"], "--rate"),
    ],
)
def test_bad_sources_are_one_line(
    words: list[str], wanted: str, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    out = ["--out", str(tmp_path / "d.toml"), "--check"]
    assert main(["design", "wam", *words, *out]) == 2
    said = capsys.readouterr().err.strip()
    assert wanted in said
    assert len(said.splitlines()) == 1


@pytest.mark.thorough
def test_what_is_kept_for_the_report_decides_nothing(
    found: Design, throws: tuple[Throw, ...], tmp_path: Path
) -> None:
    """Throws or flights of the half that no search sees, made quicker or moved: all is the same.

    Aim, box, speeds, the ranges that maps are learned on, and those of the arm file.
    """
    whole, scene = found.whole, read_scene("lab")
    throws = throws[:40]
    other = {id(x) for x in unseen(throws)}
    moved = [Throw(r=x.r + 0.02, dr=1.2 * x.dr) if id(x) in other else x for x in throws]
    tasks = []
    for name, rows in (("as-they-are", list(throws)), ("moved", moved)):
        path = tmp_path / f"{name}.csv"
        lines = [",".join(map(repr, [*x.r.tolist(), *x.dr.tolist()])) for x in rows]
        path.write_text("\n".join(["x,y,z,vx,vy,vz", *lines]))
        options = DesignOptions(arm="wam", out=tmp_path / "d.toml", throws_file=path)
        tasks.append(_task(options, whole, scene))
    _same_but_for_what_is_kept(found, tasks)
    flights = builtin_flights()
    other = {id(x) for x in unseen(flights)}
    tasks = []
    for factor in (1.0, 1.3):
        path = tmp_path / f"flights-{factor}.csv"
        samples = [
            f"{x.name},{t / (factor if id(x) in other else 1.0)!r},{r[0]!r},{r[1]!r},{r[2]!r}"
            for x in flights
            for t, r in zip(x.t.tolist(), x.r.tolist(), strict=True)
        ]
        path.write_text("\n".join(["flight,t_s,x_m,y_m,z_m", *samples]))
        options = DesignOptions(arm="wam", out=tmp_path / "d.toml", flights=path)
        tasks.append(_task(options, whole, scene))
    _same_but_for_what_is_kept(found, tasks)


def _same_but_for_what_is_kept(found: Design, tasks: list[DesignTask]) -> None:
    """Hold two tasks to the same decisions, and to different throws for the report."""
    one, two = tasks
    assert to_plain(one.balls) == to_plain(two.balls)
    assert one.arrivals is not None
    assert two.arrivals is not None
    assert np.array_equal(one.arrivals, two.arrivals)
    assert release_speed(one) == release_speed(two)
    if one.throws:
        files = [
            replace(found, task=x).arm_file(ArmFile(arm="wam", limits="wam-80v")) for x in tasks
        ]
        assert files[0].throws == files[1].throws
        assert [x.dr.tolist() for x in one.throws] != [x.dr.tolist() for x in two.throws]
    else:
        assert [x.t.tolist() for x in one.recordings] != [x.t.tolist() for x in two.recordings]
