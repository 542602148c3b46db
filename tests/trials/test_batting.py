"""Batting: how a return is scored, what a hit tells, and whole trials of an arm with a paddle."""

import json
from dataclasses import replace
from functools import cache
from itertools import islice
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from mitt.cli.main import main
from mitt.clock import Stopwatch
from mitt.core.arm.tools import Paddle
from mitt.core.ball.flight import advance
from mitt.core.catcher.batting import Batting, BattingSettings
from mitt.core.catcher.catcher import Catcher
from mitt.core.catcher.planner import PIECES
from mitt.core.errors import InputError, ModelError
from mitt.core.signals import Array, BallState, Sighting
from mitt.core.verdict.feasibility import Outcome, Verdict
from mitt.core.verdict.pieces import Pieces
from mitt.io.arm_file import load_arm
from mitt.io.recordings import Recorded, write_recording
from mitt.lab.trials.bat_station import BatStation, bat_station, impact_of
from mitt.lab.trials.batting import (
    BAT,
    BatRunner,
    BatTrial,
    returned_velocity,
    true_scene,
)
from mitt.lab.trials.landing import CLOSE, NEAR, landing, nearest, paddle_of
from mitt.lab.trials.replayed import changed, replay
from mitt.lab.trials.result import run_summary
from mitt.lab.trials.source import source_of
from mitt.lab.world.scene import named_scene, scene_of

TARGET = np.array([3.0, 0.0, 0.3])
seeds = st.integers(0, 2**31)


@cache
def station(*, shield: bool = False) -> BatStation:
    """Return the station of the WAM."""
    return bat_station(
        "wam", scene=named_scene("lab"), target=None if shield else TARGET, limits="wam-48v"
    )


def runner(count: int, *, shield: bool = False) -> BatRunner:
    """Return what runs trials that are seen as points."""
    s = station(shield=shield)
    source = source_of(s.arm, seed=1, drag=s.scene.ball.drag, count=count)
    return BatRunner(s, source, pixels=False)


@given(seed=seeds)
def test_a_path_is_as_near_as_its_nearest_point(seed: int) -> None:
    """By straight pieces."""
    rng = np.random.default_rng(seed)
    start, way = np.array([0.5, 0.0, 0.5]), np.array([5.0, *rng.uniform(-1.0, 1.0, 2)])
    path = start + np.linspace(0.0, 1.0, 200)[:, None] * way
    unit = way / np.linalg.norm(way)
    off = TARGET - start
    exact = float(np.linalg.norm(off - (off @ unit) * unit))
    assert nearest(path, TARGET) == pytest.approx(exact, abs=1e-9)


@given(seed=seeds)
def test_a_ball_lands_where_its_flight_comes_down_to_the_targets_height(seed: int) -> None:
    """Within the way of a millisecond, wherever it goes; along its way and to the left of that."""
    rng = np.random.default_rng(seed)
    ball, path = np.array([[0.6, 0.0, 0.7], rng.uniform([2, -1, -1], [6, 1, 4])]), []
    while ball[0, 2] > TARGET[2] - 0.2:
        path.append(ball[0].copy())
        advance(ball[0], ball[1], 0.04, 1e-3)
    found = landing(np.array(path), TARGET)
    above = [r for r in path if r[2] > TARGET[2]]
    assert found is not None
    assert np.hypot(*found) == pytest.approx(np.linalg.norm((above[-1] - TARGET)[:2]), abs=0.008)
    assert found[0] == pytest.approx(above[-1][0] - TARGET[0], abs=0.008)
    assert found[1] == pytest.approx(above[-1][1] - TARGET[1], abs=0.003)


def test_a_ball_that_does_not_come_down_at_the_targets_height_has_not_landed() -> None:
    """One that touches something above it, or flies below it all the time; rising is no landing."""
    down = np.linspace([0.5, 0.0, 0.5], [3.0, 0.0, 0.2], 50)
    assert landing(down, TARGET) is not None
    assert landing(down[:20], TARGET) is None
    assert landing(down - [0.0, 0.0, 0.3], TARGET) is None
    assert landing(down[::-1], TARGET) is None


def _scored(**of: Any) -> BatTrial:  # noqa: ANN401 (fields of a trial)
    """Return a trial with some fields."""
    known: dict[str, Any] = dict.fromkeys(BatTrial.__dataclass_fields__)
    return BatTrial(**(known | {"limit_violations": 0} | of))


@given(errors=st.lists(st.none() | st.floats(0.0, 5.0), min_size=1, max_size=40))
def test_all_balls_count_in_the_score(errors: list[float | None]) -> None:
    """Those that were refused or missed are in every share and percentile, as far as can be."""
    trials = [
        _scored(
            status="unreachable" if x is None else ("returned" if x <= NEAR else "wide"),
            landing_m=x,
        )
        for x in errors
    ]
    said = run_summary(BAT, trials, Stopwatch())
    assert said["throws"] == len(errors)
    assert said["within_10_cm"] == sum(x is not None and x <= CLOSE for x in errors)
    assert said["return_rate"] * len(errors) == pytest.approx(
        sum(x is not None and x <= NEAR for x in errors)
    )
    ranked = sorted(np.inf if x is None else x for x in errors)
    for percent, name in ((0.5, "median_landing_m"), (0.9, "p90_landing_m")):
        value = ranked[int(np.ceil(percent * len(ranked) - 1e-9)) - 1]
        assert said[name] == (None if np.isinf(value) else value)


@given(seed=seeds)
def test_the_velocity_after_a_hit_is_found_from_what_is_seen(seed: int) -> None:
    """Within what the noise of 1 mm leaves, with a point that is far off; too few tell nothing."""
    rng = np.random.default_rng(seed)
    start, seen = np.array([[0.6, 0.0, 0.7], rng.uniform([3, -1, -1], [6, 1, 3])]), []
    for k in range(100):
        ball = start.copy()
        advance(ball[0], ball[1], 0.045, 1e-3 * k)
        r_o = ball[0] + 1e-3 * rng.standard_normal(3) + (0.5 if k == 50 else 0.0)
        seen.append(Sighting(t=2.0 + 1e-3 * k, found=True, r_o=r_o, covariance=1e-6 * np.eye(3)))
    found = returned_velocity(seen, 2.0, 0.045)
    assert found is not None
    assert found == pytest.approx(start[1], abs=0.025)
    assert returned_velocity(seen[:8], 2.0, 0.045) is None


def test_a_run_has_a_rubber_and_a_lift_of_its_own() -> None:
    """The same for the same seed, each off what is told by a share of at most its mismatch."""
    scene, paddle = named_scene("lab"), Paddle()
    told, drawn = impact_of(scene, paddle), [true_scene(scene, paddle, k) for k in range(40)]
    assert drawn[3] == true_scene(scene, paddle, 3)
    found = [impact_of(x, paddle) for x in drawn]
    off = scene.mismatch
    for name, most, value in (
        ("restitution", off.restitution, told.restitution),
        ("fall", off.fall, told.fall),
        ("lift", off.lift, told.lift),
        ("loss", off.tangential * paddle.tangential / (1.0 + paddle.tangential), told.loss),
    ):
        shares = np.array([getattr(x, name) for x in found]) / value - 1.0
        assert np.abs(shares).max() <= most + 1e-9
        assert np.ptp(shares) > most


def test_the_readout_of_the_scenes_shutters_is_known() -> None:
    """Else what the two cameras see is not brought to one instant."""
    scene = named_scene("lab")
    sensing = scene.sensing.model_copy(update={"readout": 0.02})
    rolling = scene.model_copy(update={"sensing": sensing})
    at = bat_station("wam", scene=rolling, target=TARGET, limits="wam-48v", learns=False)
    assert [camera.readout for camera in at.rig.cameras] == [0.02, 0.02]
    assert [camera.readout for camera in station().rig.cameras] == [0.0, 0.0]


def test_a_spin_is_aimed_with() -> None:
    """A ball that spins is hit, and lands nearer than if no spin was believed."""
    table = {"base": "lab", "ball": {"spin": 100.0}, "mismatch": {"tangential": 0.0, "lift": 0.0}}
    scene = scene_of(table, place="test")
    at = replace(station(), scene=scene)
    blind = replace(at, batting=replace(at.batting, settings=_blind(at)))
    ball = scene.ball
    source = source_of(at.arm, seed=8, drag=ball.drag, count=3, spinning=ball.spinning)
    assert np.linalg.norm(source.ball(0).spin) == pytest.approx(100.0)
    off = []
    for s in (at, blind):
        trials = [BatRunner(s, source, pixels=False).trial(k) for k in range(3)]
        off.append([3.0 if t.landing_m is None else t.landing_m for t in trials])
    assert np.median(off[0]) < 0.5 * np.median(off[1])


def _blind(at: BatStation) -> BattingSettings:
    """Return settings of a catcher that believes in no spin."""
    return replace(at.batting.settings, spin=(0.0, 0.0, 0.0))


def test_an_arm_without_a_paddle_does_not_bat() -> None:
    """It is told."""
    with pytest.raises(ModelError, match="a paddle"):
        paddle_of(load_arm("wam"))


def test_balls_are_hit_to_the_target_and_tell_of_the_restitution() -> None:
    """Within every limit, in the middle of the face; run again, it gives the same."""
    of = runner(3)
    told = of.known.restitution.mean
    true = true_scene(station().scene, paddle_of(of.arm), 1).contact.restitution
    trials = list(of.run())
    hits = [t for t in trials if t.status == "returned"]
    assert len(hits) >= 2
    for t in hits:
        assert t.limit_violations == 0
        assert t.landing_m is not None
        assert t.miss_m is not None
        assert t.off_middle_mm is not None
        assert t.miss_m < 0.15
        assert t.miss_m <= t.landing_m <= 0.25
        assert t.off_middle_mm < 10.0
    assert true is not None
    assert of.known.restitution.mean == pytest.approx(true, rel=0.02)
    assert of.known.restitution.sigma < 0.5 * 0.03 * told
    assert list(islice(runner(3).run(), 2)) == trials[:2]


def test_a_trial_is_replayed_to_the_bit(tmp_path: Path) -> None:
    """With images; a rival's is not recorded, and a replay of batting takes no other map."""
    s = station()
    source = source_of(s.arm, seed=1, drag=s.scene.ball.drag, count=1)
    of = BatRunner(s, source, keeps=True)
    write_recording(tmp_path / "trial.mcap", of.recording(of.trial(0)))
    recorded = Recorded(tmp_path / "trial.mcap")
    assert recorded.has_images
    assert replay(recorded).identical
    with pytest.raises(InputError, match="batting"):
        changed(recorded.about, generator="ik")
    rival = BatRunner(s, source, pixels=False, generator="ik")
    with pytest.raises(InputError, match="of the map, got ik"):
        rival.recording(rival.trial(0))
    with pytest.raises(InputError, match=r"recording.*kept"):
        BatRunner(s, source, pixels=False).recording(of.trial(0))


def coming(t: float, speed: float, before: float) -> BallState:
    """Return a ball that passes the middle of the WAM's box so long after it is looked at [s]."""
    aim = station().arm.model.aim
    assert aim is not None
    r, v = aim[0].copy(), speed * np.array([-0.9, 0.0, -0.435])
    advance(r, v, 0.045, -before)
    return BallState(t=t, r_o=r, dr_o=v, drag=0.045)


def test_a_trial_does_not_know_what_was_planned_in_the_one_before() -> None:
    """Its first ball, seen 10 ms later in its trial, comes sooner; it is met when it comes."""
    s, q = station(), station().arm.q_ready
    told = s.batting.settings
    one, two = s.generator(told), s.generator(told)
    alone = s.generator(told).verdict(coming(0.11, 5.7, 0.36), q)
    one.verdict(coming(0.1, 5.7, 0.48), q)
    assert two.verdict(coming(0.11, 5.7, 0.36), q) == alone


def test_a_refusal_names_the_limit_that_forbade_it() -> None:
    """Also when the ball has come so near that nothing can be planned any more."""
    s = station()
    g, q = s.generator(s.batting.settings), s.arm.q_ready + np.array([1.5, 0.0, 0.0, 0.0])
    early = g.verdict(coming(0.1, 6.0, 0.17), q)
    late = g.verdict(coming(0.24, 6.0, 0.03), q)
    assert early.outcome is late.outcome is Outcome.UNSETTLED
    assert early.binding_limit != "domain"
    assert late.binding_limit == early.binding_limit


def test_a_shield_stops_balls() -> None:
    """They touch the face first, within every limit; there is no target to be missed."""
    trials = list(runner(2, shield=True).run())
    assert all(t.status == "returned" and t.limit_violations == 0 for t in trials)
    assert all(t.miss_m is None and t.landing_m is None for t in trials)


def test_the_command_writes_what_the_contract_says(
    tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    """One object on stdout, the same in the file, and a page."""
    out = tmp_path / "bat"
    words = ["bat", "--throws", "2", "--seed", "1", "--vision", "points", "--json"]
    assert main([*words, "--out", str(out)]) == 0
    said = json.loads(capsys.readouterr().out)
    assert said == json.loads((out / "result.json").read_text())
    assert said["schema"] == "mitt.bat/1"
    assert said["summary"]["throws"] == len(said["trials"]) == 2
    assert "Where the balls land" in (out / "report.html").read_text()
    rival = ["--record", "all", "--generator", "ik"]
    for wrong in (
        rival,
        ["--target", "1,2"],
        ["--speed", "7,5"],
        ["--shield", "--target", "3,0,0"],
    ):
        assert main(["bat", *wrong, "--check"]) == 2


def test_a_strike_is_worked_out_a_few_pieces_a_tick(monkeypatch: pytest.MonkeyPatch) -> None:
    """No call of a loop works more out, and piece by piece it is the verdict that it is at once."""
    worked, of, think = [0], Pieces.of, Catcher.think

    def counted(pieces: Pieces, *args: Any, **kwargs: Any) -> Any:  # noqa: ANN401
        before, answer = len(pieces._known), of(pieces, *args, **kwargs)
        worked[-1] += len(pieces._known) > before
        return answer

    def thought(catcher: Catcher) -> None:
        worked.append(0)
        think(catcher)

    judged = list[tuple[Verdict, Verdict]]()
    consider = Batting.consider

    def considered(
        g: Batting, ball: BallState, q: Array, dq: Array | None, pieces: Pieces
    ) -> tuple[Verdict, Batting]:
        answer = consider(g, ball, q, dq, pieces)
        if g.strike is None:
            whole = replace(g, memory=type(g.memory)())
            monkeypatch.setattr(Pieces, "of", of)
            judged.append((answer[0], consider(whole, ball, q, dq, Pieces())[0]))
            monkeypatch.setattr(Pieces, "of", counted)
        return answer

    monkeypatch.setattr(Pieces, "of", counted)
    monkeypatch.setattr(Catcher, "think", thought)
    monkeypatch.setattr(Batting, "consider", considered)
    assert runner(1).trial(0).status == "returned"
    assert 0 < max(worked) <= PIECES
    assert any(by_pieces.outcome is Outcome.FEASIBLE for by_pieces, _ in judged)
    for by_pieces, at_once in judged:
        if by_pieces.outcome is Outcome.FEASIBLE:
            assert (by_pieces.share, by_pieces.t_catch) == (at_once.share, at_once.t_catch)
