"""Maps on disk: they come back to the bit, and no altered one is taken for sound."""

import hashlib
import json
from collections.abc import Callable
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from hypothesis import HealthCheck, given, settings
from hypothesis import strategies as st

from mitt.core.arm.arm import Arm
from mitt.core.errors import FileError
from mitt.core.map.learn import Learned
from mitt.core.map.map_design import MapDesign
from mitt.core.map.neighbourhood import Neighbourhood, learn
from mitt.io.load import build_arm
from mitt.io.maps import read_map, save_map
from mitt.version import __version__


@pytest.fixture(scope="module")
def saved(tmp_path_factory: pytest.TempPathFactory, learned: Learned) -> Path:
    """A saved map."""
    path = tmp_path_factory.mktemp("maps") / "map.json"
    save_map(path, learned, version="0.0.test")
    return path


def signed(content: dict[str, Any]) -> str:
    """Return a map's content with the checksum that belongs to it."""
    content.pop("checksum", None)
    canonical = json.dumps(content, sort_keys=True, separators=(",", ":"))
    content["checksum"] = hashlib.sha256(canonical.encode()).hexdigest()
    return json.dumps(content)


def test_a_map_comes_back_to_the_bit(saved: Path, learned: Learned, arm: Arm) -> None:
    """Coefficients, metric, basis, region, design and history are the saved ones."""
    again = read_map(saved, arm)
    mine, theirs = learned.map, again.map
    for a, b in (
        (mine.alpha, theirs.alpha),
        (mine.H, theirs.H),
        (mine.region, theirs.region),
        (mine.basis.centre, theirs.basis.centre),
        (mine.basis.scale, theirs.basis.scale),
        (mine.packed, theirs.packed),
    ):
        assert np.array_equal(a, b)
    assert theirs.design == mine.design
    assert (again.steps, again.flights, again.left_out, again.status) == (
        learned.steps,
        learned.flights,
        learned.left_out,
        learned.status,
    )


def test_a_map_with_a_slope_that_weighs_the_match_comes_back(tmp_path: Path, arm: Arm) -> None:
    """Its monomials of first order too; it gives the same motions."""
    design = MapDesign(slope=(0.1, -0.2), match_weight=0.5)
    soft = learn(arm, design=design, around=Neighbourhood(flights=12, instants=6))
    save_map(tmp_path / "soft.json", soft)
    again = read_map(tmp_path / "soft.json", arm)
    assert again.map.design == design
    assert again.map.equals(soft.map)


def test_a_map_says_which_version_wrote_it(tmp_path: Path, learned: Learned, arm: Arm) -> None:
    """This one, unless the caller says another; it can be read again."""
    path = tmp_path / "map.json"
    save_map(path, learned)
    assert json.loads(path.read_text())["version"] == __version__
    assert read_map(path, arm).status == learned.status


def test_saving_twice_gives_the_same_bytes(tmp_path: Path, saved: Path, learned: Learned) -> None:
    """Nothing of the clock or the machine enters the file."""
    save_map(tmp_path / "again.json", learned, version="0.0.test")
    assert (tmp_path / "again.json").read_bytes() == saved.read_bytes()


@settings(max_examples=60, suppress_health_check=[HealthCheck.function_scoped_fixture])
@given(share=st.floats(0.0, 0.999))
def test_a_map_cut_short_is_refused(tmp_path: Path, saved: Path, arm: Arm, share: float) -> None:
    """Cut anywhere, but for the final newline, the file is no map."""
    text = saved.read_text().rstrip()
    cut = tmp_path / "cut.json"
    cut.write_text(text[: min(int(share * len(text)), len(text) - 1)])
    with pytest.raises(FileError):
        read_map(cut, arm)


@settings(max_examples=60, suppress_health_check=[HealthCheck.function_scoped_fixture])
@given(place=st.floats(0.0, 1.0), digit=st.sampled_from("0123456789"))
def test_an_altered_digit_never_passes(
    tmp_path: Path, saved: Path, arm: Arm, learned: Learned, place: float, digit: str
) -> None:
    """One digit changed anywhere is refused, unless every number reads as before."""
    text = saved.read_text()
    digits = [k for k, letter in enumerate(text) if letter.isdigit()]
    k = digits[min(int(place * len(digits)), len(digits) - 1)]
    altered = text[:k] + digit + text[k + 1 :]
    path = tmp_path / "altered.json"
    path.write_text(altered)
    if json.loads(altered) == json.loads(text):
        assert np.array_equal(read_map(path, arm).map.alpha, learned.map.alpha)
        return
    with pytest.raises(FileError):
        read_map(path, arm)


def test_the_checksum_is_named_where_it_does_not_fit(tmp_path: Path, saved: Path, arm: Arm) -> None:
    """A coefficient changed by hand: the message says altered, and what to do."""
    content = json.loads(saved.read_text())
    content["alpha"][0][0] += 1e-6
    path = tmp_path / "altered.json"
    path.write_text(json.dumps(content))
    with pytest.raises(FileError, match="altered; learn it again"):
        read_map(path, arm)


def test_a_map_of_other_limits_is_refused(saved: Path) -> None:
    """Learned for one limit set, it is no map for another; both are named."""
    with pytest.raises(FileError, match=r"limits wam-48v.*limits paper"):
        read_map(saved, build_arm("wam", limits="wam-48v"))


def _other_link(arm: Arm, **changed: Any) -> Arm:  # noqa: ANN401
    """Return the arm with something else in its last link."""
    links = arm.model.links
    model = replace(arm.model, links=(*links[:-1], replace(links[-1], **changed)))
    return Arm(model, arm.limits)


def _others(arm: Arm) -> dict[str, Arm]:
    """Return arms of the same name, joints and limit set's name that are others."""
    model, limits = arm.model, arm.limits
    longer, last = model.tool.copy(), model.links[-1]
    longer[2, 3] += 0.05
    weaker = replace(limits, tau_peak=0.1 * limits.tau_peak)
    return {
        "masses": _other_link(arm, mass=1.001 * last.mass),
        "inertias": _other_link(arm, inertia=1.01 * last.inertia),
        "rotor inertias": _other_link(arm, armature=last.armature + 1e-4),
        "joint ranges": _other_link(arm, q_max=last.q_max - 0.01),
        "tool frame": Arm(replace(model, tool=longer), limits),
        "ready pose": Arm(replace(model, q_ready=model.q_ready + 1e-3), limits),
        "peak torques": Arm(model, weaker),
        "jerks": Arm(model, replace(limits, jerk=np.full(len(model.links), 1e4))),
    }


@pytest.mark.parametrize("what", sorted(_others(build_arm("wam"))))
def test_a_map_knows_its_arm_by_its_numbers(saved: Path, arm: Arm, what: str) -> None:
    """An arm of the same name is refused, in one line that says what differs."""
    with pytest.raises(FileError, match=f"its {what} ") as caught:
        read_map(saved, _others(arm)[what])
    assert "\n" not in str(caught.value)


def test_an_arm_whose_last_digits_differ_is_the_same(saved: Path, arm: Arm) -> None:
    """Rounding of another platform, 1e-13, is no other arm."""
    other = _other_link(arm, mass=arm.model.links[-1].mass * (1.0 + 1e-13))
    assert read_map(saved, other).map.alpha.shape[1] == arm.n


def test_a_map_of_a_later_version_is_refused(tmp_path: Path, saved: Path, arm: Arm) -> None:
    """What a later mitt wrote may mean something else; the message names the version."""
    content = json.loads(saved.read_text())
    content["version"] = "99.0.0"
    path = tmp_path / "later.json"
    path.write_text(signed(content))
    with pytest.raises(FileError, match=r"version.*99\.0\.0"):
        read_map(path, arm)


SPOILT: dict[str, Callable[[dict[str, Any]], object]] = {
    "unknown key": lambda c: c.update(comment="hello"),
    "missing key": lambda c: c.pop("alpha"),
    "schema": lambda c: c.update(schema="mitt.map/1"),
    "later version": lambda c: c.update(version="99.0.0"),
    "no version": lambda c: c.update(version="new"),
    "no numbers of the arm": lambda c: c.update(identity={}),
    "ragged": lambda c: c["alpha"][0].pop(),
    "too few rows": lambda c: c["alpha"].pop(),
    "indefinite": lambda c: c.update(H=(-np.array(c["H"])).tolist()),
    "void scale": lambda c: c["scale"].__setitem__(0, 0.0),
    "wrong joint": lambda c: c["design"].update(catch_joint=7),
    "unknown free joint": lambda c: c["design"].update(free=[0, 2, 9]),
    "text": lambda c: c["alpha"][0].__setitem__(0, "a lot"),
    "huge order": lambda c: c["design"].update(order=10**9),
    "far catch": lambda c: c["design"].update(q_catch=40.0),
    "small kappa": lambda c: c["design"].update(kappa=0.0),
    "short region": lambda c: c["region"].pop(),
}


@pytest.mark.parametrize("spoil", SPOILT.values(), ids=SPOILT)
def test_a_signed_map_that_does_not_fit_together_is_refused(
    tmp_path: Path, saved: Path, arm: Arm, spoil: Callable[[dict[str, Any]], object]
) -> None:
    """Even with a right checksum: unknown or missing keys, wrong shapes, impossible designs."""
    content = json.loads(saved.read_text())
    spoil(content)
    path = tmp_path / "spoilt.json"
    path.write_text(signed(content))
    with pytest.raises(FileError) as caught:
        read_map(path, arm)
    assert "\n" not in str(caught.value)


@pytest.mark.parametrize("text", ["[]", "1", '"map"', "null", "{}"])
def test_json_that_is_no_map_is_refused(tmp_path: Path, arm: Arm, text: str) -> None:
    """Any other JSON is a file error, not a fault."""
    path = tmp_path / "x.json"
    path.write_text(text)
    with pytest.raises(FileError):
        read_map(path, arm)
