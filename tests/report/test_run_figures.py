"""The figures show what the logs say, stand inside a page, and leave their inputs alone."""

import base64
import re
from dataclasses import asdict, replace
from xml.etree import ElementTree

import numpy as np
import pytest
from matplotlib.figure import Figure

from mitt.core.arm.arm import Arm
from mitt.core.errors import ShapeError
from mitt.core.map.learn import Learned
from mitt.core.signals import Array
from mitt.lab.report.pictures import picture_strip
from mitt.lab.report.run_figures import (
    catching_trajectory,
    contact_errors,
    feedback_share,
    joint_angles,
    joint_torques,
    learning_cost,
    releases,
    target_and_hand,
)
from mitt.lab.report.style import LEARNED, Plot, plot
from mitt.lab.trials.log import TrialLog
from mitt.lab.trials.runner import LoggedTrial
from mitt.lab.world.scene import Scene

#: A curve on the page may be off by this share of its height: simplified, two decimals.
_ON_PAGE = 0.02


def _log(outcome: LoggedTrial) -> TrialLog:
    assert outcome.log is not None
    return outcome.log


def _all(arm: Arm, learned: Learned, direct: LoggedTrial, unoptimised: LoggedTrial) -> list[Plot]:
    """Draw every figure."""
    log, plain = _log(direct), _log(unoptimised)
    trials = [asdict(direct.trial), asdict(unoptimised.trial)]
    return [
        learning_cost(learned.steps),
        catching_trajectory(arm, log, plain),
        target_and_hand(arm, log),
        joint_angles(arm, log, plain),
        joint_torques(arm, log, plain),
        contact_errors(trials),
        releases(trials, np.array([[3.5, 0.1, 0.2], [3.9, -0.1, 0.4]])),
    ]


@pytest.fixture(scope="module")
def plots(arm: Arm, learned: Learned, direct: LoggedTrial, unoptimised: LoggedTrial) -> list[Plot]:
    """All figures, drawn once."""
    return _all(arm, learned, direct, unoptimised)


def test_each_figure_is_one_well_formed_svg_without_addresses(plots: list[Plot]) -> None:
    """A figure is one <svg> element, parses as XML and names no address outside itself."""
    for drawn in plots:
        assert ElementTree.fromstring(drawn.svg).tag == "svg"  # noqa: S314 (our own text)
        assert "://" not in drawn.svg
        assert set(re.findall(r'href="(.)', drawn.svg)) <= {"#"}


def test_ids_differ_between_figures_and_every_reference_is_kept(plots: list[Plot]) -> None:
    """No id occurs twice on a page with all figures, and each reference finds its id."""
    ids = [x for p in plots for x in re.findall(r'\bid="([^"]+)"', p.svg)]
    assert len(ids) == len(set(ids))
    for drawn in plots:
        used = re.findall(r"url\(#([^)]+)\)", drawn.svg) + re.findall(r'href="#([^"]+)', drawn.svg)
        assert used
        assert set(used) <= set(ids)


def test_the_same_data_give_the_same_text_and_are_left_alone(
    arm: Arm, learned: Learned, direct: LoggedTrial, unoptimised: LoggedTrial, plots: list[Plot]
) -> None:
    """Drawn twice, a figure is the same, byte for byte; arrays of a log may be read-only."""
    frozen = []
    for outcome in (direct, unoptimised):
        log = _log(outcome)
        parts = {n: getattr(log, n).copy() for n in ("desired", "encoders", "tau", "ball", "t")}
        for array in parts.values():
            array.setflags(write=False)
        frozen.append(LoggedTrial(outcome.trial, replace(log, **parts)))
    names = ("qpos", "position", "t")
    before = [getattr(_log(direct).truth, name).copy() for name in names]
    again = _all(arm, learned, frozen[0], frozen[1])
    assert [p.svg for p in again] == [p.svg for p in plots]
    for name, value in zip(names, before, strict=True):
        np.testing.assert_array_equal(value, getattr(_log(direct).truth, name))


def test_every_axis_names_its_unit(plots: list[Plot]) -> None:
    """Each figure with quantities on its axes writes units in brackets."""
    wanted = {
        "fig7": "[1]",
        "fig8": "[m]",
        "fig9": "[s]",
        "fig10": "[rad]",
        "fig11": "[N m]",
        "errors": "[mm]",
        "releases": "[m]",
    }
    found = {p.name: p.svg for p in plots}
    for name, unit in wanted.items():
        assert unit in found[name], name


def _dots(svg: str) -> list[Array]:
    """Return the dotted paths of a figure, each as its points on the page, shape (k, 2)."""
    paths = re.findall(r'<path d="([^"]+)"[^>]*stroke-linecap: round', svg)
    points = [re.findall(r"M ([\d.]+) ([\d.]+)", d) for d in paths]
    return [np.array(p, float) for p in points if len(p) > 100]


def test_fig_8_has_a_dot_for_each_millisecond(arm: Arm, direct: LoggedTrial) -> None:
    """Each tick's catch point is drawn until 0.1 s after the catch, and the ball where in view.

    One scale takes the world to the page: fitted to the catch point it holds for the ball.
    """
    log = _log(direct)
    rows = np.flatnonzero(log.truth.t <= log.t_catch + 0.1 + 1e-9)
    drawn = _dots(catching_trajectory(arm, log, None).svg)
    assert len(drawn) == 4
    for ball, hand, axis in ((drawn[0], drawn[1], 2), (drawn[2], drawn[3], 1)):
        assert len(hand) == len(rows)
        for column, k in ((0, 0), (1, axis)):
            scale = np.polyfit(log.truth.position[rows, k], hand[:, column], 1)
            seen = np.polyval(scale, log.truth.r_o[rows[-len(ball) :], k])
            np.testing.assert_allclose(ball[:, column], seen, atol=0.1)


def test_fig_10_draws_the_arm_where_its_encoders_were(arm: Arm, direct: LoggedTrial) -> None:
    """The dotted curve of joint 1, scaled back from the page, is the log's own curve."""
    log = _log(direct)
    svg = joint_angles(arm, log, None).svg
    (curve, *_) = re.findall(rf'<path d="([^"]+)"[^>]*stroke: {LEARNED}', svg)
    x, y = np.array([p.split() for p in re.findall(r"[ML] ([\d. -]+)", curve)], float).T
    shown = log.t <= log.t_catch + 0.2 + 1e-9
    q = log.encoders[shown, 0, 0]
    times = np.interp(x, [x.min(), x.max()], [0.0, log.t[shown][-1]])
    angles = q.min() + (y.max() - y) / np.ptp(y) * np.ptp(q)
    np.testing.assert_allclose(
        angles, np.interp(times, log.t, log.encoders[:, 0, 0]), atol=_ON_PAGE * np.ptp(q)
    )


def test_feedback_share_is_that_of_the_formula(direct: LoggedTrial) -> None:
    """The share is 0 for pure feedforward, 1 without feedforward, and scales with the rest."""
    log = _log(direct)
    assert feedback_share(replace(log, feedforward=log.tau)) == 0.0
    assert feedback_share(replace(log, feedforward=np.zeros_like(log.tau))) == pytest.approx(1.0)
    assert feedback_share(replace(log, feedforward=0.75 * log.tau)) == pytest.approx(0.25)
    assert feedback_share(replace(log, following=np.zeros_like(log.following))) == 0.0


def test_learning_lowers_the_controllers_load(
    direct: LoggedTrial, unoptimised: LoggedTrial
) -> None:
    """Section 3.6: with the learned map the share of feedback is below that of alpha = 0."""
    assert feedback_share(_log(direct)) < 0.6 * feedback_share(_log(unoptimised))


def test_pictures_come_every_33_ms_and_one_shows_the_catch(
    arm: Arm, scene: Scene, direct: LoggedTrial
) -> None:
    """Fig. 12: distances of 33 ms to a millisecond, PNGs, one of them at the catch."""
    strip = picture_strip("fig12", arm, scene, _log(direct)).shots
    assert np.all(np.abs(np.diff([shot.t for shot in strip]) - 1.0 / 30.0) <= 1.001e-3)
    assert [shot.t for shot in strip if shot.catch] == [
        pytest.approx(direct.trial.t_catch_s, abs=0.501e-3)
    ]
    assert all(base64.b64decode(shot.png).startswith(b"\x89PNG") for shot in strip)


def test_throws_without_contact_can_be_drawn(direct: LoggedTrial) -> None:
    """A run in which nothing was touched still has its figures."""
    missed = asdict(
        replace(direct.trial, status="missed", position_error_mm=None, velocity_error_m_s=None)
    )
    assert "no ball was touched" in contact_errors([missed]).svg
    assert "missed (1)" in releases([missed], np.array([[3.0, 0.0, 0.0]])).svg


def test_a_throw_that_was_never_followed_can_be_drawn(arm: Arm, direct: LoggedTrial) -> None:
    """A refused throw has a log without references and without a catch."""
    log = _log(direct)
    idle = replace(log, following=np.zeros_like(log.following), t_0=np.inf, t_catch=np.inf)
    for drawn in (
        catching_trajectory(arm, idle, None),
        target_and_hand(arm, idle),
        joint_angles(arm, idle, idle),
        joint_torques(arm, idle, idle),
    ):
        assert drawn.svg.startswith("<svg")


def test_a_throw_with_lost_readings_can_be_drawn(arm: Arm, direct: LoggedTrial) -> None:
    """Encoders that say nothing for a while, or nothing at all, leave a gap."""
    log = _log(direct)
    for lost in (slice(200, 260), slice(None)):
        encoders = log.encoders.copy()
        encoders[lost, :, 1] = np.nan
        silent = replace(log, encoders=encoders)
        assert joint_angles(arm, silent, silent).svg.startswith("<svg")
        assert joint_torques(arm, silent, None).svg.startswith("<svg")


def test_releases_must_match_the_trials(direct: LoggedTrial) -> None:
    """One release for each trial, else a refusal that says so."""
    with pytest.raises(ShapeError, match=r"\(1, 3\)"):
        releases([asdict(direct.trial)], np.zeros((2, 3)))


def _hostile(figure: Figure) -> None:
    """Draw a title that would be a script."""
    figure.suptitle("<script>x</script>")


def test_labels_are_escaped() -> None:
    """Text in a figure cannot become markup."""
    drawn = plot("hostile", (2.0, 1.0), _hostile)
    assert "<script" not in drawn.svg
    assert "&lt;script" in drawn.svg
