"""Wrong values in every place of everything public: one line that says what was wanted.

What is public is found by looking (:mod:`surface.names`), so a new name or parameter that has no
right value in :mod:`surface.cases` fails here.
"""

import os
from collections.abc import Iterator
from pathlib import Path

import numpy as np
import pytest
from hypothesis import HealthCheck, given, settings
from hypothesis import strategies as st
from hypothesis.extra import numpy as hnp
from soak.examples import ball_of
from surface import names, wrong
from surface.cases import RESULTS, URDF, Case, Cases

import mitt
from mitt.core.catcher.generators import Direct
from mitt.core.errors import InputError, MittError, ModelError
from mitt.core.map.mapping import unlearned

_TAKEN = {
    name: taken
    for name, taken in names.callables()
    if name not in RESULTS and not name.startswith("gym.Environment.")
}
#: Words of what is inside, or of Python's own errors: no message of mitt has them.
_INSIDE = (
    "numba",
    "Traceback",
    "object has no attribute",
    "unexpected keyword",
    "pydantic",
    "NoneType' object",
    "TypingError",
)
_LONGEST = 700


@pytest.fixture(scope="module")
def cases(tmp_path_factory: pytest.TempPathFactory) -> Iterator[dict[str, Case]]:
    """All cases; what a call writes, it writes in a folder of the test."""
    folder, before = tmp_path_factory.mktemp("surface"), Path.cwd()
    os.chdir(folder)
    yield Cases(folder).all
    os.chdir(before)


def clear(error: MittError) -> str:
    """Return what is wrong with a message; nothing where it is one clear line."""
    said = str(error)
    if not said.isprintable() or not 0 < len(said) <= _LONGEST:
        return f"not one line: {said[:200]!r}"
    if any(word in said for word in _INSIDE):
        return f"speaks of what is inside: {said}"
    says = ("wanted " in said and ", got " in said) or "must have shape" in said
    return "" if says else f"does not say what was wanted and given: {said}"


def fault(case: Case, key: str, value: object, *, must: bool) -> str:
    """Return how a call with one value changed ends otherwise than it should; nothing if not."""
    told = f"{key} = {type(value).__name__} {str(value)[:40]!r}: "
    try:
        answer = case.call(**(case.right | {key: value}))
    except MittError as error:
        unclear = clear(error)
        return told + unclear if unclear else ""
    except Exception as error:
        return f"{told}{type(error).__name__}: {str(error)[:100]}"
    if must and not case.converts and not case.answers(key, value):
        return f"{told}was taken"
    return told + "NaN came out" if case.answers(key, value) and has_nan(answer) else ""


def has_nan(answer: object) -> bool:
    """Say whether there is NaN among the numbers of an answer."""
    if isinstance(answer, np.ndarray):
        return answer.dtype.kind == "f" and bool(np.isnan(answer).any())
    return isinstance(answer, tuple) and any(map(has_nan, answer))


def test_everything_public_has_a_right_value(cases: dict[str, Case]) -> None:
    """Each function, constructor and method, and each of their parameters."""
    assert sorted(set(_TAKEN) - set(cases)) == []
    for name, taken in _TAKEN.items():
        assert sorted({x.name for x in taken} - set(cases[name].right)) == [], name
    assert sorted(set(cases) - set(_TAKEN)) == []


@pytest.mark.parametrize("name", sorted(_TAKEN))
def test_wrong_values_are_refused_in_one_clear_line(cases: dict[str, Case], name: str) -> None:
    """Types, shapes, NaN, huge numbers, texts with control characters, things of another kind."""
    case, found = cases[name], []
    for taken in _TAKEN[name]:
        right = case.right[taken.name]
        refused = list(wrong.refused(right))
        if taken.default is not None and "None" not in str(taken.annotation):
            refused.append(None)
        found += [fault(case, taken.name, x, must=True) for x in refused]
        if not case.slow:
            found += [fault(case, taken.name, x, must=False) for x in wrong.doubtful(right)]
    assert [x for x in found if x] == []


_ANYTHING = st.one_of(
    st.none(),
    st.booleans(),
    st.integers(),
    st.floats(),
    st.text(),
    st.binary(),
    st.complex_numbers(),
    st.lists(st.one_of(st.floats(), st.text(), st.none()), max_size=5),
    st.dictionaries(st.text(), st.one_of(st.floats(), st.text()), max_size=3),
    hnp.arrays(
        st.one_of(hnp.scalar_dtypes(), hnp.unicode_string_dtypes()),
        hnp.array_shapes(min_dims=0, max_dims=3, min_side=0, max_side=5),
    ),
)
_QUICK = sorted(
    set(_TAKEN) - {"learn", "simulate", "Recorder", "gym.CatchEnv", "gym.CatchPixelsEnv"}
)


@settings(max_examples=600, suppress_health_check=list(HealthCheck))
@given(data=st.data())
def test_anything_at_all_is_answered_or_refused(
    data: st.DataObject, cases: dict[str, Case]
) -> None:
    """Whatever is put in whatever place: an answer, or one clear line."""
    name = data.draw(st.sampled_from(_QUICK))
    key = data.draw(st.sampled_from([x.name for x in _TAKEN[name]]))
    assert fault(cases[name], key, data.draw(_ANYTHING), must=False) == ""


_CONTENTS = (
    b"",
    b"\x00\xff" * 100,
    b"[[[[",
    b"a = 1\n",
    b"{}",
    b"[]",
    b"null",
    b"a,b\n1,2\n",
    b"<robot/>",
    b'{"schema": "one\\u001b[31m"}',
    b'schema = "mitt.arm/1"\n',
    b"<mujoco/>",
    b"[ball]\nmass = nan\n",
    '"\u2028\x1b" = 1\n'.encode(),
    b"x,y,z,vx,vy,vz\n1,2,3,4,5,nan\n",
    b"1" * 5000,
    b"flight,t_s,x_m,y_m,z_m\n\x1b[31m,1e999,0,0,0\n",
)


@pytest.mark.parametrize("suffix", ["toml", "json", "csv", "urdf", "xml", "png"])
@pytest.mark.parametrize("name", sorted(names.readers()))
def test_files_that_say_something_else_are_refused(
    cases: dict[str, Case], tmp_path: Path, name: str, suffix: str
) -> None:
    """Whatever stands in a file of whatever kind: an answer, or one clear line; folders, too."""
    found, (_, key) = [], names.readers()[name]
    for k, content in enumerate(_CONTENTS):
        path = tmp_path / f"{k}.{suffix}"
        path.write_bytes(content)
        found.append(fault(cases[name], key, path, must=False))
    folder = tmp_path / f"folder.{suffix}"
    folder.mkdir()
    found.append(fault(cases[name], key, folder, must=True))
    assert [x for x in found if x] == []


def test_degrees_and_another_order_are_known_where_a_range_tells() -> None:
    """A ready pose, a held angle, the angle of the catch and a reading: the remedy is named."""
    own = {"tip": "palm", "joints": ["yaw", "pitch", "elbow"]}
    with pytest.raises(ModelError, match=r"ready pose of j2: .*angles are in rad"):
        mitt.load_arm("wam", ready=[0.0, 45.0, 90.0])
    with pytest.raises(ModelError, match=r"ready pose of pitch: .*angles are in rad"):
        mitt.load_arm(URDF, ready=[0.0, 45.0, 90.0], **own)  # type: ignore[arg-type]
    with pytest.raises(InputError, match=r"held j3: .*angles are in rad"):
        mitt.load_arm("wam", held={"j3": 90.0})
    arm = mitt.load_arm("wam")
    with pytest.raises(ModelError, match=r"q_catch: .*angles are in rad"):
        _ = unlearned(arm, mitt.MapDesign(q_catch=90.0)).tangent
    f = unlearned(arm, mitt.MapDesign())
    with pytest.raises(InputError, match=r"q: .*angles are in rad"):
        f.adapt(ball_of(), np.array([0.0, 45.0, 90.0]), np.zeros(3))


def test_a_map_of_another_arm_is_refused() -> None:
    """Of another tool, other joints or another description: by the catcher, which moves the arm."""
    arm, other = mitt.load_arm("wam"), mitt.load_arm("wam", hand="basket")
    f = unlearned(other, mitt.MapDesign())
    with pytest.raises(InputError, match="learn a map for this arm"):
        mitt.Catcher(arm, Direct(f))
    mitt.Catcher(other, Direct(f))
