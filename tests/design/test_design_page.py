"""The page of a design, and what would help: laws of the numbers that stand on it."""

import re
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

from mitt.cli import designing as command
from mitt.cli.options import DesignOptions
from mitt.core.arm.arm import Arm
from mitt.lab.design import interception as module
from mitt.lab.design.arm_design import AtSpeed, Design
from mitt.lab.design.candidate import Candidate
from mitt.lab.design.geometry import candidates_of, drawn, triples_of
from mitt.lab.design.interception import LONGER, QUICKER, faster_joints, longer_arm
from mitt.lab.design.poses import Touch
from mitt.lab.design.task import Balls
from mitt.lab.report.design_page import advice_of, force_in_words, write_design_page
from mitt.lab.world.scene import read_scene

#: How far the gain of a quicker joint may be off when it is measured on a quicker arm [m/s].
_ROUNDED = 1e-6


def _some(whole: Arm, count: int) -> list[Candidate]:
    rng = np.random.default_rng(7)
    rows = drawn(
        whole,
        Balls(),
        triples_of(whole, None),
        rng,
        count=2000,
        touch=Touch(whole, read_scene("ideal")),
    )
    return candidates_of(whole, Balls(), rows.take(np.arange(count)), rng)


def test_a_quicker_joint_never_makes_a_catch_harder(whole: Arm) -> None:
    helped = 0
    for c in _some(whole, 60):
        for x in faster_joints(whole, c, Balls()):
            assert x.quicker_m_s <= x.relative_m_s + _ROUNDED
            assert 0.0 <= x.share <= 0.9 + _ROUNDED
            helped += x.quicker_m_s < x.relative_m_s - 0.1
    assert helped > 10


def test_only_a_joint_at_its_limit_helps(whole: Arm) -> None:
    idle = 0
    for c in _some(whole, 60):
        for x in faster_joints(whole, c, Balls()):
            if x.share < 0.9 - 1e-3:
                assert x.quicker_m_s >= x.relative_m_s - 1e-3
                idle += 1
    assert idle > 10


def test_an_arm_with_that_joint_meets_balls_as_softly(whole: Arm) -> None:
    plain = replace(whole.limits, transmission=np.eye(whole.n))  # joints have their own drives
    for c in _some(whole, 10):
        rows = faster_joints(Arm(whole.model, plain), c, Balls())
        best = min(rows, key=lambda x: x.quicker_m_s)
        speeds = plain.dq_max.copy()
        speeds[whole.names.index(best.joint)] *= QUICKER
        limits = replace(plain, dq_max=speeds)
        theirs = faster_joints(Arm(whole.model, limits), c, Balls())[0].relative_m_s
        assert theirs == pytest.approx(best.quicker_m_s, abs=_ROUNDED)


def test_words_name_the_joint_and_the_limit(found: Design, whole: Arm) -> None:
    row = AtSpeed(speed_m_s=6.0, throws=12, feasible=3, binding_limit="brake:j4")
    helps = faster_joints(whole, _some(whole, 1)[0], Balls())
    said = advice_of(replace(found, rows=(row,)), helps, helps[0].relative_m_s - 0.5)
    assert any("6 m/s" in line and "j4" in line for line in said)
    assert any("longer" in line for line in said)
    none = advice_of(replace(found, rows=(row,)), helps, helps[0].relative_m_s)
    assert not any("longer" in line for line in none)


def test_longer_links_are_as_good_as_all_joints_faster_by_as_much(whole: Arm) -> None:
    """A hand at the same pose moves as much faster, whichever of the two it is."""
    longer = 0
    for c in _some(whole, 60):
        catch = module._catch_of(whole, c, Balls())
        now, then = catch.least(catch.allowed), longer_arm(whole, c, Balls())
        assert then <= now + _ROUNDED
        assert then == pytest.approx(min(catch.least(LONGER * catch.allowed), now), abs=1e-9)
        longer += then < now - 0.1
    assert longer > 10


def test_the_page_stands_alone(found: Design, tmp_path: Path) -> None:
    path = tmp_path / "my-arm.html"
    row = AtSpeed(speed_m_s=6.0, throws=12, feasible=3, binding_limit="speed:j2")
    scene = read_scene("lab")
    command = "design wam --out 'my arm.toml'"
    write_design_page(path, replace(found, rows=(row,)), scene, command=command)
    text = path.read_text()
    assert "http://" not in text
    assert "https://" not in text
    assert "What the arm can catch" in text
    assert text.count("data:image/png;base64,") == 3
    assert "Where balls may come" in text
    assert "speed\nj2" in re.sub(r"</?(?:text|tspan)[^>]*>\s*", "\n", text).replace("\n\n", "\n")
    assert "<h1>What my-arm can catch</h1>" in text
    assert "<code>mitt design wam --out &#39;my arm.toml&#39;</code>" in text


def test_a_hard_catch_is_said_in_words(found: Design) -> None:
    """A soft design needs none; for a hard one with fingers there is a basket."""
    assert found.best is not None
    soft, hard = (replace(found, best=replace(found.best, force=force)) for force in (40.0, 635.0))
    assert force_in_words(soft) == ""
    assert "65 kg" in force_in_words(hard)
    assert "--hand basket" in force_in_words(hard)
    assert force_in_words(replace(found, best=None)) == ""


def test_the_page_names_the_whole_command() -> None:
    options = DesignOptions(arm="wam", out=Path("my arm.toml"), rate=0.9, aim="0.8,0,0", json=True)
    assert command._words(options) == ("design wam --out 'my arm.toml' --aim 0.8,0,0 --rate 0.9")
