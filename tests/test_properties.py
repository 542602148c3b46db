"""Public functions on arrays of any type and shape: an error of mitt, or the answer for them."""

import warnings
from typing import Any

import numpy as np
from hypothesis import HealthCheck, given, settings
from hypothesis import strategies as st
from hypothesis.extra import numpy as hnp
from soak.arrays import methods
from soak.examples import Examples

from mitt.core.arm.arm import Arm
from mitt.core.errors import MittError
from mitt.core.map.mapping import DirectMap

_EXAMPLES = Examples()
#: Objects whose methods are pure: what they answer depends on what they are given alone.
_PURE = {
    place: thing
    for place, thing in _EXAMPLES.objects().items()
    if place in ("arm", "arm.limits", "map", "map.basis", "direct", "rival")
}
_METHODS = [
    (place, type(thing).__name__, name, [p.name for p in taken if p.default is p.empty])
    for place, thing in _PURE.items()
    for name, taken in methods(thing)
]
_ANYTHING = hnp.arrays(
    st.one_of(hnp.scalar_dtypes(), hnp.byte_string_dtypes(), hnp.unicode_string_dtypes()),
    hnp.array_shapes(min_dims=0, max_dims=3, min_side=0, max_side=6),
)


def _answer(place: str, name: str, values: dict[str, Any]) -> Any:  # noqa: ANN401
    """Return what a method says, or the error of mitt that it ends in."""
    with warnings.catch_warnings():
        warnings.simplefilter("ignore", RuntimeWarning)  # of infinite numbers, which stay so
        try:
            return getattr(_PURE[place], name)(**values)
        except MittError as error:
            return error


@settings(max_examples=400, deadline=None, suppress_health_check=list(HealthCheck))
@given(data=st.data())
def test_any_array_is_refused_or_means_the_same_as_its_numbers(data: st.DataObject) -> None:
    """Of whatever type, shape and order: refused in one line, or as if given as float64."""
    place, kind, name, taken = data.draw(st.sampled_from(_METHODS))
    right = {key: _EXAMPLES.example(kind, name, key) for key in taken}
    wanted = data.draw(st.sampled_from(taken))
    given_array = data.draw(_ANYTHING)
    answer = _answer(place, name, right | {wanted: given_array})
    if isinstance(answer, MittError):
        assert "\n" not in str(answer)
        return
    if isinstance(right[wanted], np.ndarray):
        assert (
            given_array.ndim == right[wanted].ndim
            or place == "arm.limits"
            or name in ("active", "by_joint")
        )
        assert given_array.dtype.kind in "fiu"
        plain = given_array.astype(np.float64, order="C")
        again = _answer(place, name, right | {wanted: plain})
        assert type(again) is type(answer)
        if isinstance(answer, np.ndarray):
            assert np.array_equal(answer, again, equal_nan=True)


@settings(max_examples=200, deadline=None)
@given(q=hnp.arrays(np.float64, 3, elements=st.floats(-10.0, 10.0)))
def test_poses_of_any_form_have_one_position(q: np.ndarray[Any, Any]) -> None:
    """The catch point of a pose is that of its list, of its window and of its frozen copy."""
    arm, f = _EXAMPLES.arm, _EXAMPLES.f
    assert isinstance(arm, Arm)
    assert isinstance(f, DirectMap)
    frozen = q.copy()
    frozen.flags.writeable = False
    for form in (q.tolist(), np.repeat(q, 2)[::2], frozen, q[::-1].copy()[::-1]):
        assert np.array_equal(arm.position(form), arm.position(q))
        assert np.array_equal(f.to_ball(form), f.to_ball(q))


@settings(max_examples=300, deadline=None)
@given(ball=hnp.arrays(np.float64, (3, 3), elements=st.floats(allow_nan=True, width=64)))
def test_the_map_is_finite_whatever_the_ball(ball: np.ndarray[Any, Any]) -> None:
    """Every row that the map gives is finite, NaN and 1e300 included."""
    inside, rows = _EXAMPLES.f.motion(ball)
    assert np.isfinite(rows).all()
    assert not (inside and not np.isfinite(ball).all())
