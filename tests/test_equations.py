"""Every numbered equation of the paper is cited in the code, and the citing code runs."""

import re
import sys
from pathlib import Path
from types import FrameType

import numpy as np
import pytest
from support import ball_state, parabola

import mitt
from mitt.core.map.demand import demand
from mitt.core.map.learn import learn_from
from mitt.core.map.map_design import MapDesign
from mitt.io.load import build_arm

#: The paper prints 1 to 20 and 22; 21 is the summary of its section 3.6.
NUMBERED = (*range(1, 21), 22)
SOURCE = Path(mitt.__file__).parent
_CITED = re.compile(r"eqs?\.\s+((?:\(\d+[ab]?\)(?:\s*(?:,|and|to)\s*)?)+)")


def cited(text: str) -> set[int]:
    """Return the equation numbers that a docstring cites."""
    found: set[int] = set()
    for group in _CITED.findall(" ".join(text.split())):
        numbers = [int(n) for n in re.findall(r"\((\d+)", group)]
        found.update(numbers)
        if " to " in group:
            found.update(range(numbers[0], numbers[-1] + 1))
    return found


def executed_docstrings() -> list[str]:
    """Learn a map, adapt it, follow a ball; return the docstrings of all functions that ran."""
    seen: set[tuple[str, str]] = set()
    docs: list[str] = []

    def watch(frame: FrameType, event: str, _arg: object) -> None:
        code = frame.f_code
        if event != "call" or not code.co_filename.startswith(str(SOURCE)):
            return
        key = (code.co_filename, code.co_qualname)
        if key not in seen:
            seen.add(key)
            doc = code.co_consts[0] if code.co_consts else None
            docs.append(doc if isinstance(doc, str) else "")

    arm, rng = build_arm("wam"), np.random.default_rng(0)
    flights = [parabola(arm, rng, instants=8) for _ in range(4)]
    sys.setprofile(watch)
    try:
        f = learn_from(arm, MapDesign(), flights).map
        r_o, dr_o, ddr_o = flights[0].ball[0]
        ball = ball_state(r_o, dr_o, ddr_o)
        adapted = f.adapt(ball, arm.q_ready, np.zeros(3))
        reference = adapted.reference(ball)
        adapted.catch_gap(r_o)
        adapted.F(r_o)
        adapted.to_ball(reference.q_o)
        demand(arm, np.array([[reference.q_d, reference.dq_d, reference.ddq_d]]))
    finally:
        sys.setprofile(None)
    return docs


@pytest.mark.parametrize("number", NUMBERED)
def test_each_numbered_equation_is_cited_by_code_that_runs(number: int, docs: list[str]) -> None:
    """The docstring of at least one function that just ran cites the equation."""
    assert any(number in cited(doc) for doc in docs), f"eq. ({number}) is not cited by running code"


@pytest.fixture(scope="module")
def docs() -> list[str]:
    """Docstrings of what one learning, adaptation and evaluation executes."""
    return executed_docstrings()
