"""What tests share: the arm, a few flights, a learned map, and a fixed Hypothesis profile."""

import os
import signal
from pathlib import Path

# As in the command line, and before NumPy is loaded: matrices are small, and cores are busy.
os.environ.setdefault("OPENBLAS_NUM_THREADS", "1")

import numpy as np
import pytest
from hypothesis import HealthCheck, settings
from support import parabola

from mitt.core.arm.arm import Arm
from mitt.core.map.learn import Flight, Learned, learn_from
from mitt.core.map.map_design import MapDesign
from mitt.core.map.mapping import DirectMap, unlearned
from mitt.io.load import build_arm

settings.register_profile(
    "mitt", derandomize=True, deadline=None, suppress_health_check=[HealthCheck.too_slow]
)
settings.load_profile("mitt")

# Tests that run in the background begin with interrupts ignored, those under nohup with SIGHUP, and
# so would their processes.
signal.signal(signal.SIGINT, signal.default_int_handler)
signal.signal(signal.SIGHUP, signal.SIG_DFL)


@pytest.hookimpl(tryfirst=True)
def pytest_sessionstart(session: pytest.Session) -> None:
    """Compile before several processes begin to test, as each would compile the same."""
    if session.config.getoption("numprocesses", None):
        from mitt.lab.trials.runs import warming  # noqa: PLC0415 (where one process tests, not needed)
        from mitt.lab.trials.source import source_of  # noqa: PLC0415
        from mitt.lab.world.scene import Scene  # noqa: PLC0415

        arm, design = build_arm("wam"), MapDesign()
        ball = source_of(arm, seed=1, count=1, drag=Scene().ball.drag).ball(0)
        with warming(arm, design, Scene(), ball, pixels=True, progress=lambda *_: None):
            rng = np.random.default_rng(11)
            learn_from(arm, design, [parabola(arm, rng) for _ in range(40)])


@pytest.fixture
def watched_shortly(monkeypatch: pytest.MonkeyPatch) -> None:
    """Watch for 20 ms instead of two seconds how late ticks come here."""
    monkeypatch.setattr("mitt.clock._WATCHED", 20)


@pytest.fixture(scope="session")
def arm() -> Arm:
    """The WAM with the limits that the paper's experiment needs."""
    return build_arm("wam", limits="paper")


@pytest.fixture(scope="session")
def plain(arm: Arm) -> DirectMap:
    """The map with alpha = 0."""
    return unlearned(arm, MapDesign())


@pytest.fixture(scope="session")
def flights(arm: Arm) -> list[Flight]:
    """Forty drag-free flights."""
    rng = np.random.default_rng(11)
    return [parabola(arm, rng) for _ in range(40)]


@pytest.fixture(scope="session")
def learned(arm: Arm, flights: list[Flight]) -> Learned:
    """A map learned from them."""
    return learn_from(arm, MapDesign(), flights)


@pytest.fixture(scope="session")
def thrown_study(tmp_path_factory: pytest.TempPathFactory, learned: Learned) -> Path:
    """The folder of the small study after it was thrown here; to be copied, not written to."""
    from small_study import TEXT, Here, quiet, ready, write_study  # noqa: PLC0415 (needs pyarrow)

    from mitt.lab.trials.study_run import run_study  # noqa: PLC0415

    place = tmp_path_factory.mktemp("thrown_study")
    study = write_study(place, TEXT)
    folder = ready(place / "out", study, learned)
    assert run_study(study, folder, Here(), progress=quiet).status == 0
    return folder.path
