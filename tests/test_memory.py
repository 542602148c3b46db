"""No call reads or frees what is not its own, and copies of objects go on by themselves.

What could crash the interpreter runs in one of its own, under ``faulthandler``.
"""

import json
import os
import pickle
import subprocess
import sys
from collections.abc import Callable
from concurrent.futures import ThreadPoolExecutor
from copy import copy, deepcopy
from dataclasses import replace
from typing import Any

import numpy as np
import pytest
from numba.core import event
from support import arrays_in

import mitt
from mitt.core.arm.arm import Arm
from mitt.core.catcher.catcher import Catcher, CatcherSettings
from mitt.core.catcher.family import Family
from mitt.core.catcher.generators import Direct, Generator, Unoptimised, refining
from mitt.core.errors import FileError, InputError, MittError, ShapeError, UnknownNameError
from mitt.core.eyes.camera import fixed_rig
from mitt.core.eyes.eyes import Eyes, EyesConfig
from mitt.core.map.learn import Learned
from mitt.core.signals import ArmState, Command, Frame, Senses
from mitt.lab.trials.runner import TrialRunner
from mitt.lab.world.scene import Scene
from mitt.lab.world.throws import Throw

THROW = Throw(r=np.array([3.2, 0.05, 0.1]), dr=np.array([-5.0, -0.05, 2.4]))
#: Ticks until the arm is under way, and those that copies are compared over.
UNDER_WAY = 150
COMPARED = 200

#: A throw played on a world of which nobody holds anything but the stage, with all that is freed
#: overwritten by other worlds.
_STAGE = """
import faulthandler, gc, json, sys
faulthandler.enable()
import numpy as np
from mitt.core.map.map_design import default_design
from mitt.core.catcher.generators import Unoptimised
from mitt.core.map.mapping import unlearned
from mitt.clock import Stopwatch
from mitt.io.load import build_arm
from mitt.lab.trials.play import play_out
from mitt.lab.trials.runner import TrialRunner
from mitt.lab.world.scene import Scene
from mitt.lab.world.simulation import World
from mitt.lab.world.throws import Throw
arm = build_arm("wam")
throw = Throw(r=np.array([3.2, 0.05, 0.1]), dr=np.array([-5.0, -0.05, 2.4]))
def played(alone):
    f = unlearned(arm, default_design(arm))
    runner = TrialRunner(arm, Unoptimised(f), Scene(), pixels=False)
    runner.world.reset(throw, 7)
    catcher, stage, world = runner.catcher(), runner.world.stage, runner.world
    if alone:
        del runner, world
        gc.collect()
        others = [World(Scene(), arm.model) for _ in range(3)]
        for other in others:
            other.data.qpos[:] = 7.0
    ticks = play_out(stage, catcher, Stopwatch(), longest=2.0, held=0.6)
    return ticks.command.copy()
"""
#: The catcher of that throw, stepped by hand; in each tick all that no one holds may be collected.
_STEPS = """
from mitt.core.catcher.catcher import Catcher, CatcherSettings
from mitt.core.eyes.camera import fixed_rig
from mitt.core.eyes.eyes import Eyes
def told(collects):
    world = World(Scene(), arm.model)
    f = unlearned(arm, default_design(arm))
    eyes, generator = Eyes(fixed_rig()), Unoptimised(f)
    catcher = Catcher(arm, generator, eyes, settings=CatcherSettings())
    del f, eyes, generator
    world.reset(throw, 7)
    rows = []
    gc.freeze()  # what was there before is not looked through in each tick
    for k in range(250):
        senses = world.sense()
        command = catcher.step(senses)
        del senses
        if collects: gc.collect()
        world.apply(command)
        rows.append(command.joints)
        del command
        if collects: gc.collect()
        catcher.think()
    last = world.sense()
    del world, catcher
    gc.unfreeze()
    gc.collect()
    return np.array(rows), last.arm.q
plain, collected = told(False), told(True)
same = all(np.array_equal(a, b) for a, b in zip(plain, collected))
steps = same and bool(np.isfinite(collected[0]).all())
print(json.dumps([steps, bool(np.array_equal(played(False), played(True)))]))
"""


def run(code: str) -> Any:  # noqa: ANN401 (any JSON value)
    """Return what code prints as JSON in a fresh interpreter, which must not crash."""
    done = subprocess.run(
        [sys.executable, "-X", "faulthandler", "-c", code],
        env=os.environ | {"PYTHONPATH": os.pathsep.join(path for path in sys.path if path)},
        capture_output=True,
        text=True,
        timeout=2400,
        check=False,
    )
    assert done.returncode == 0, done.stderr[-3000:]
    return json.loads(done.stdout.splitlines()[-1])


@pytest.fixture(scope="module")
def runner(arm: Arm, learned: Learned) -> TrialRunner:
    """The default world, seen as points."""
    return TrialRunner(arm, Direct(learned.map), Scene(), pixels=False)


@pytest.mark.thorough
def test_a_catch_bears_a_collection_of_garbage_and_a_stage_outlives_its_world() -> None:
    """Every owner deleted, garbage collected in each tick, or before a throw: the same, to the bit.

    Catcher and world stepped by hand, and a throw once world and runner have been collected.
    """
    assert run(_STAGE + _STEPS) == [True, True]


def test_no_value_of_the_wrong_shape_or_type_gets_past_a_public_function() -> None:
    """Every public function, each parameter: an error of one line, or the right answer."""
    code = (
        "import json, warnings; warnings.simplefilter('ignore')\n"
        "from soak import arrays, examples\n"
        "count = arrays.sweep(examples.Examples())\n"
        "print(json.dumps([count.faults, count.calls, count.refused, len(count.functions)]))"
    )
    faults, calls, refused, functions = run(code)
    assert faults == []
    assert functions > 80
    assert 0.2 * calls < refused < calls


def values(catcher: Catcher) -> list[str]:
    """Return all that a catcher knows and remembers."""
    return [repr(x.tolist()) for x in arrays_in(catcher.state)]


def begun(runner: TrialRunner, ticks: int = UNDER_WAY) -> tuple[Catcher, list[Senses]]:
    """Return a catcher some ticks into a throw, and what reaches it in the ticks after."""
    world, catcher = runner.world, runner.catcher()
    world.reset(THROW, 5)
    for _ in range(ticks):
        world.apply(catcher.step(world.sense()))
        catcher.think()
    later = []
    twin = deepcopy(catcher)
    for _ in range(COMPARED):
        later.append(world.sense())
        world.apply(twin.step(later[-1]))
        twin.think()
    return catcher, later


def commands(catcher: Catcher, senses: list[Senses]) -> list[bytes]:
    """Return what a catcher commands, tick by tick."""
    told = []
    for s in senses:
        told.append(catcher.step(s).joints.tobytes())
        catcher.think()
    return told


_COPIES: dict[str, Callable[[Any], Any]] = {
    "copy": copy,
    "deepcopy": deepcopy,
    "pickle": lambda x: pickle.loads(pickle.dumps(x)),  # noqa: S301
}


@pytest.mark.parametrize("how", sorted(_COPIES))
@pytest.mark.parametrize("kind", ["direct", "refining"])
def test_a_copied_catcher_goes_on_as_the_first_would(
    arm: Arm, learned: Learned, runner: TrialRunner, kind: str, how: str
) -> None:
    """In the middle of a throw: the same commands, and neither of the two knows of the other."""
    if kind == "refining":
        runner = TrialRunner(arm, refining(learned.map), Scene(), pixels=False)
    catcher, senses = begun(runner)
    other = _COPIES[how](catcher)
    mine = commands(catcher, senses)
    theirs = commands(other, senses)
    told = [np.frombuffer(x).reshape(4, -1) for x in (mine[-1], theirs[-1])]
    if kind == "direct":
        assert mine == theirs
    else:  # the solver starts cold in the copy: equal to its tolerance
        np.testing.assert_allclose(told[0][:2], told[1][:2], atol=1e-3)
    assert np.any(told[1][:2] != 0.0)
    assert other.phase is catcher.phase


def test_two_catchers_with_the_same_eyes_do_not_share_them(arm: Arm, learned: Learned) -> None:
    """What one sees is unknown to the other, and to the eyes that were handed over."""
    eyes = Eyes(fixed_rig(), EyesConfig())
    before = [value.copy() for value in eyes.memory]
    one, two = (
        Catcher(arm, Direct(learned.map), eyes, settings=CatcherSettings()) for _ in range(2)
    )
    pixels = np.random.default_rng(1).integers(0, 256, (128, 128), dtype=np.uint8)
    frames = tuple(Frame(t=0.0, camera=k, number=1, pixels=pixels) for k in range(2))
    known = values(two)
    one.step(Senses(t=0.0, arm=ArmState(t=0.0, q=arm.q_ready, dq=np.zeros(arm.n)), frames=frames))
    assert values(two) == known
    for value, old in zip(eyes.memory, before, strict=True):
        assert value.tobytes() == old.tobytes()


def _answer(thing: Any) -> Any:  # noqa: ANN401
    """Return what tells whether a copy is right."""
    if isinstance(thing, Arm):
        return thing.torque(thing.q_ready, thing.q_ready, thing.q_ready)
    if isinstance(thing, mitt.DirectMap):
        return thing.motion(np.array([THROW.r, THROW.dr, np.zeros(3)]))[1]
    return thing.as_map().motion(np.array([THROW.r, THROW.dr, np.zeros(3)]))[1]


@pytest.mark.parametrize("how", sorted(_COPIES))
def test_arms_maps_and_generators_survive_copies(arm: Arm, learned: Learned, how: str) -> None:
    """A copy gives the same answers."""
    f, direct = learned.map, Direct(learned.map)
    generators: tuple[Generator, ...] = (direct, refining(f), Unoptimised(f), Family((direct,)))
    for thing in (arm, f, *generators):
        assert np.array_equal(_answer(_COPIES[how](thing)), _answer(thing))
    settings = CatcherSettings(bandwidth=60.0)
    assert _COPIES[how](settings).bandwidth == 60.0
    limits = _COPIES[how](arm.limits)
    assert np.array_equal(limits.packed, arm.limits.packed)


def test_a_world_refuses_to_be_copied(runner: TrialRunner) -> None:
    """In one line that says what to do: its state lies in MuJoCo's memory."""
    for how in _COPIES.values():
        with pytest.raises(InputError, match="make another"):
            how(runner.world)


def _errors() -> list[MittError]:
    """Return an error of every kind."""
    kinds: list[type[MittError]] = [MittError]
    for kind in kinds:
        kinds += kind.__subclasses__()
    made: list[MittError] = [
        MittError("text"),
        ShapeError("q", "(3,)", (4,)),
        FileError("f", "a map", object()),
        InputError("x", "a number", lambda: 0, do="give one"),
        UnknownNameError("arm", "x", ["y"]),
    ]
    return made + [
        kind("x", "a", "b")
        for kind in kinds
        if issubclass(kind, InputError)
        and kind not in map(type, made)
        and "__init__" not in vars(kind)
    ]


@pytest.mark.parametrize("error", _errors(), ids=lambda error: type(error).__name__)
def test_errors_pass_through_a_pickle(error: MittError) -> None:
    """Type, text and names come back, whatever was given, so that a pool can pass errors on."""
    again = pickle.loads(pickle.dumps(error))  # noqa: S301
    assert type(again) is type(error)
    assert str(again) == str(error)
    assert vars(again).get("name") == vars(error).get("name")
    assert str(copy(error)) == str(deepcopy(error)) == str(error)


def test_an_error_comes_back_from_a_pool_of_processes() -> None:
    """Instead of a pool that hangs: the caller gets the error that the worker raised."""
    code = (
        "import json\n"
        "from concurrent.futures import ProcessPoolExecutor\n"
        "from multiprocessing import get_context\n"
        "from mitt.core.checks import vector\n"
        "from mitt.core.errors import ShapeError\n"
        "if __name__ == '__main__':\n"
        "    with ProcessPoolExecutor(1, mp_context=get_context('fork')) as pool:\n"
        "        try:\n"
        "            pool.submit(vector, 'q', [1.0], 3).result(timeout=60)\n"
        "        except ShapeError as error:\n"
        "            print(json.dumps([error.name, list(error.given)]))\n"
    )
    assert run(code) == ["q", [1]]


def test_kinematics_may_be_asked_from_several_threads(arm: Arm, learned: Learned) -> None:
    """Each thread gets the answers for its own pose: none is overwritten by another's."""
    rng = np.random.default_rng(2)
    poses = arm.q_ready + 0.3 * rng.standard_normal((8, arm.n))
    f = learned.map

    def answers(q: np.ndarray[Any, Any]) -> tuple[Any, ...]:
        return (
            arm.position(q),
            arm.jacobian(q),
            arm.orientation(q),
            arm.mass_matrix(q),
            arm.torque(q, q, q),
            f.to_ball(q),
            *arm.torque_derivatives(q, q, q),
        )

    wanted = [answers(q) for q in poses]

    def wrong(k: int) -> int:
        found = (answers(poses[k]) for _ in range(300))
        return sum(not all(map(np.array_equal, x, wanted[k])) for x in found)

    interval = sys.getswitchinterval()
    sys.setswitchinterval(1e-6)
    try:
        with ThreadPoolExecutor(8) as pool:
            assert sum(pool.map(wrong, range(8))) == 0
    finally:
        sys.setswitchinterval(interval)


def test_nothing_compiles_inside_a_tick(arm: Arm, learned: Learned) -> None:
    """Encoders and images of any type or flag are converted, and one tick has one signature."""
    eyes, n = Eyes(fixed_rig()), arm.n
    catcher = Catcher(arm, Direct(learned.map), eyes, settings=CatcherSettings())
    pixels, still = np.zeros((128, 128), np.uint8), np.zeros(n)
    locked = pixels.copy()
    locked.flags.writeable = False
    images = (pixels, locked, np.asfortranarray(pixels), np.zeros((256, 256), np.uint8)[::2, ::2])
    frozen = arm.q_ready.copy()
    frozen.flags.writeable = False
    poses: tuple[Any, ...] = (
        arm.q_ready,
        frozen,
        arm.q_ready.astype(np.float32),
        arm.q_ready.tolist(),
        np.repeat(arm.q_ready, 2)[::2],
        arm.q_ready.astype(">f8"),
        tuple(arm.q_ready),
    )
    first = Senses(t=0.0, arm=ArmState(t=0.0, q=poses[0], dq=still))
    catcher.step(first)
    with event.install_recorder("numba:compile") as compiled:
        for k, q in enumerate(poses):
            catcher.step(Senses(t=0.001 * k, arm=ArmState(t=0.0, q=q, dq=still)))
            catcher.think()
        for k, image in enumerate(images):
            frames = tuple(Frame(t=0.1, camera=c, number=k, pixels=image) for c in range(2))
            t: Any = np.float32(0.1)
            catcher.step(Senses(t=t, arm=first.arm, frames=frames))
            catcher.think()
    assert compiled.buffer == []


@pytest.mark.parametrize("joints", [0, 2, 4, 7, 200])
def test_encoders_of_another_arm_are_refused(arm: Arm, learned: Learned, joints: int) -> None:
    """Too few or too many: one line, and the catcher goes on as if the tick had not been asked."""
    catcher = Catcher(arm, Direct(learned.map), Eyes(fixed_rig()), settings=CatcherSettings())
    good = Senses(t=0.0, arm=ArmState(t=0.0, q=arm.q_ready, dq=np.zeros(arm.n)))
    catcher.step(good)
    known = values(catcher)
    other = ArmState(t=0.001, q=np.zeros(joints), dq=np.zeros(joints))
    with pytest.raises(ShapeError, match=r"must have shape \(3,\)"):
        catcher.step(Senses(t=0.001, arm=other))
    assert values(catcher) == known


def test_an_image_of_another_size_is_refused_and_leaves_no_trace(
    arm: Arm, learned: Learned
) -> None:
    """A 640 x 480 image into a 128 x 128 rig, or grey values that are no bytes."""
    catcher = Catcher(arm, Direct(learned.map), Eyes(fixed_rig()), settings=CatcherSettings())
    good = np.zeros((128, 128), np.uint8)
    senses = Senses(t=0.0, arm=ArmState(t=0.0, q=arm.q_ready, dq=np.zeros(arm.n)))
    catcher.step(senses)
    known = values(catcher)
    frames = tuple(Frame(t=0.0, camera=k, number=1, pixels=good) for k in range(2))
    large = replace(frames[1], pixels=np.zeros((480, 640), np.uint8))
    with pytest.raises(ShapeError, match=r"\(128, 128\), not \(480, 640\)"):
        catcher.step(replace(senses, frames=(frames[0], large)))
    assert values(catcher) == known
    with pytest.raises(InputError, match="astype"):
        replace(frames[1], pixels=np.zeros((128, 128)))  # type: ignore[arg-type]
    catcher.step(replace(senses, frames=frames))


def test_a_command_of_another_arm_is_refused(runner: TrialRunner, arm: Arm) -> None:
    """The simulated arm takes torques for its own joints only."""
    runner.world.reset(THROW, 5)
    with pytest.raises(ShapeError, match=r"command\.joints"):
        runner.world.apply(Command(t=0.0, joints=np.zeros((4, arm.n + 1)), hand=0.0))
