"""The environments keep Gymnasium's rules, and the map catches in them."""

import warnings
from itertools import groupby, pairwise
from pathlib import Path
from types import SimpleNamespace
from typing import Any

import gymnasium
import numpy as np
import pytest
from gymnasium.utils.env_checker import check_env
from gymnasium.vector import AsyncVectorEnv, SyncVectorEnv
from support import BASKET_ARM, thorough

import mitt.gym
from mitt.core.catcher.settings import Phase
from mitt.core.errors import InputError
from mitt.core.map.learn import Learned
from mitt.core.signals import Command
from mitt.gym.policies import random_policy, zero_policy
from mitt.io.maps import save_map
from mitt.lab.report.pictures import placed_faces
from mitt.lab.trials.landing import Hit
from mitt.lab.world.scene import Scene, Sensing
from mitt.version import __version__

_IDS = ("mitt/Catch-v0", "mitt/CatchPixels-v0")


@pytest.fixture(scope="module")
def map_file(tmp_path_factory: pytest.TempPathFactory, learned: Learned) -> Path:
    path = tmp_path_factory.mktemp("map") / "map.json"
    save_map(path, learned, version=__version__)
    return path


def _same(a: Any, b: Any) -> bool:  # noqa: ANN401 (observations)
    if isinstance(a, dict):
        return all(_same(a[key], b[key]) for key in a)
    return bool(np.array_equal(a, b))


@pytest.mark.parametrize("action", thorough(["torque"], ["residual"]))
@pytest.mark.parametrize("name", _IDS)
def test_check_env_passes_without_warnings(name: str, action: str, map_file: Path) -> None:
    """Gymnasium's own checker: spaces, seeds, rendering, types."""
    env = gymnasium.make(name, action=action, map=map_file, render_mode="rgb_array")
    with warnings.catch_warnings():
        warnings.simplefilter("error")
        check_env(env.unwrapped)
    env.close()


@pytest.mark.parametrize("name", _IDS)
def test_boxes_are_finite_and_hold_what_is_observed(name: str) -> None:
    """Random torques to the end of a throw: always inside, and an end with a status."""
    env = gymnasium.make(name, ticks=10)
    env.action_space.seed(1)
    obs, _ = env.reset(seed=4)
    for box in env.observation_space.values() if isinstance(env.observation_space, dict) else ():
        assert np.all(np.isfinite(box.high))
    for _ in range(400):
        assert env.observation_space.contains(obs)
        obs, reward, terminated, truncated, info = env.step(env.action_space.sample())
        assert np.isfinite(float(reward))
        if terminated or truncated:
            break
    assert terminated or truncated
    assert info["status"] in ("missed", "dropped", "caught")
    assert info["limit_violations"] >= 0
    assert ("position_error_m" in info) == (info["peak_contact_force_n"] > 0.0)


def test_every_image_is_seen_whatever_the_frame_rate() -> None:
    """At 160 Hz 16 come in 0.1 s, in any tick of an action."""
    scene = Scene(sensing=Sensing(frame_rate=160.0))
    env = gymnasium.make("mitt/CatchPixels-v0", scene=scene, disable_env_checker=True)
    first = env.reset(seed=2)[0]
    seen = [first, *(env.step(env.action_space.sample())[0] for _ in range(20))]
    assert sum(not _same(a["images"], b["images"]) for a, b in pairwise(seen)) in (15, 16, 17)


@pytest.mark.parametrize("name", _IDS)
def test_the_same_seed_gives_the_same_episode(name: str) -> None:
    """Two environments, one seed: the same observations and rewards to the last bit."""
    envs = [gymnasium.make(name) for _ in range(2)]
    assert _same(*(env.reset(seed=11)[0] for env in envs))
    action = np.full(envs[0].action_space.shape or (), 0.1, np.float32)
    for _ in range(30):
        (a, r, *_), (b, s, *_) = (env.step(action) for env in envs)
        assert _same(a, b)
        assert r == s
    for k, env in enumerate(envs):
        env.reset(seed=12 + k)
    a, b = (env.step(action)[0] for env in envs)
    assert not _same(a, b)


@pytest.mark.parametrize("name", _IDS)
def test_the_map_as_baseline_catches(name: str, map_file: Path) -> None:
    """A residual of nothing is the catcher itself: it catches, and exceeds no limit."""
    env = gymnasium.make(name, action="residual", map=map_file)
    policy, caught = mitt.gym.map_policy(env), 0
    for seed in range(3):
        obs, _ = env.reset(seed=seed)
        total, over = 0.0, False
        while not over:
            obs, reward, terminated, truncated, info = env.step(policy(obs))
            total, over = total + float(reward), terminated or truncated
        caught += info["status"] == "caught"
        assert info["limit_violations"] == 0
        assert (total > 8.0) == (info["status"] == "caught")
    assert caught == 3


def test_the_map_as_a_policy_of_torques_catches(map_file: Path) -> None:
    """A millisecond an action: the torques of a catcher that goes along hold the ball."""
    env = gymnasium.make("mitt/Catch-v0", map=map_file, ticks=1)
    policy, caught = mitt.gym.map_policy(env), 0
    for seed in range(3):
        obs, _ = env.reset(seed=seed)
        over = False
        while not over:
            obs, _, terminated, truncated, info = env.step(policy(obs))
            over = terminated or truncated
        caught += info["status"] == "caught"
    assert caught >= 2


@pytest.mark.parametrize("action", ["torque", "residual"])
@pytest.mark.parametrize(
    ("task", "status", "least"), [("mitt/Meet-v0", "met", 8.0), ("mitt/Bat-v0", "returned", 4.0)]
)
def test_tasks_keep_the_rules_of_gymnasium(
    task: str, status: str, least: float, action: str
) -> None:
    """Its checker passes; a seed gives the same episode; the map does it, and is rewarded.

    One that does nothing is rewarded for less; by how far it is away, from the first step on.
    """
    env = gymnasium.make(task, action=action, ticks=1 if action == "torque" else 20)
    with warnings.catch_warnings():
        warnings.simplefilter("error")
        check_env(env.unwrapped, skip_render_check=True)
    policy, first = mitt.gym.map_policy(env), list[Any]()
    for _ in range(2):
        obs, _ = env.reset(seed=3)
        total, over = 0.0, False
        while not over:
            obs, reward, terminated, truncated, info = env.step(policy(obs))
            total, over = total + float(reward), terminated or truncated
        first.append((total, obs))
        assert info["status"] == status
        assert info["is_success"] is True
        assert total > least
    assert first[0][0] == first[1][0]
    assert _same(first[0][1], first[1][1])
    _, about = env.reset(seed=4)
    assert about["is_success"] is False
    assert np.array_equal(about["object_m"], env.unwrapped.thing()[0])  # type: ignore[attr-defined]
    still = np.zeros(env.action_space.shape or (), np.float32)
    rewards = [float(env.step(still)[1]) for _ in range(10)]
    assert len(set(rewards)) > 5 or (task, action) == ("mitt/Bat-v0", "residual")
    assert max(rewards) < 0.0


def test_only_a_ball_that_lands_has_an_error_and_its_reward(
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    """A catcher that stops has none, whatever its ball does; nor has a world that broke down."""
    env = mitt.gym.BatEnv(ticks=1)
    still = np.zeros(env.action_space.shape or (), np.float32)
    hit = Hit(off_middle=0.0, speed=3.0, lands=(0.1, 0.0))
    monkeypatch.setattr(mitt.gym, "hit_of", lambda *_: hit)
    monkeypatch.setattr(mitt.gym, "batted", lambda *_: True)
    env.reset(seed=0)
    _, reward, _, _, info = env.step(still)
    assert (info["status"], info["landing_m"], info["return_speed_m_s"]) == ("returned", 0.1, 3.0)
    assert info["is_success"]
    rests = Command(0.0, np.zeros((4, env.arm.n)), 0.0)
    stopped = SimpleNamespace(
        phase=Phase.STOPPED,
        looking=False,
        stopped_by=None,
        step=lambda _: rests,
        think=lambda: None,
    )
    monkeypatch.setattr(mitt.gym.BatEnv, "residual", property(lambda _: True))
    monkeypatch.setattr(env, "_catcher", stopped)
    _, less, _, _, info = env.step(still)
    assert (info["status"], "landing_m" in info) == ("stopped", False)
    assert not info["is_success"]
    assert less < 0.0 < reward
    monkeypatch.undo()
    env.world.apply(Command(0.0, np.full((4, env.arm.n), np.nan), 0.0))
    _, less, over, late, info = env.step(still)
    assert (info["status"], over, late) == ("aborted", True, False)
    assert less <= 0.0


@pytest.mark.parametrize("vector", [SyncVectorEnv, AsyncVectorEnv])
def test_vector_environments_of_gymnasium_work(vector: Any) -> None:  # noqa: ANN401 (their classes)
    """Two at once, in this process or in two others, give what each gives alone."""
    many = vector([lambda: gymnasium.make("mitt/Catch-v0")] * 2)
    try:
        obs, _ = many.reset(seed=[5, 6])
        actions = np.full(many.action_space.shape, 0.2, np.float32)
        for _ in range(5):
            obs, *_ = many.step(actions)
    finally:
        many.close()
    for k, seed in enumerate((5, 6)):
        env = gymnasium.make("mitt/Catch-v0")
        alone, _ = env.reset(seed=seed)
        for _ in range(5):
            alone, *_ = env.step(actions[k])
        assert np.array_equal(obs[k], alone)


def test_many_at_once_are_made_by_name() -> None:
    """``make_vec`` steps them, and says of each how it ended."""
    many = gymnasium.make_vec(
        "mitt/Catch-v0", num_envs=3, vectorization_mode="sync", vector_kwargs={}, ticks=40
    )
    obs, about = many.reset(seed=1)
    assert obs.shape == (3, 18)
    assert about["object_m"].shape == (3, 3)
    ended = np.zeros(3, bool)
    while not ended.all():
        _, _, over, late, info = many.step(np.zeros(many.action_space.shape, np.float32))
        if "is_success" in info:
            ended |= (over | late) & info["_is_success"]
    many.close()


def test_pictures_show_the_arm_and_the_ball() -> None:
    """Drawn in software, of the size that is asked for; another moment is another picture."""
    env = gymnasium.make("mitt/Catch-v0", render_mode="rgb_array", ticks=100, width=90, height=120)
    env.reset(seed=1)
    first: Any = env.render()
    env.step(np.zeros(4, np.float32))
    second: Any = env.render()
    assert first.shape == (120, 90, 3)
    assert first.dtype == np.uint8
    assert np.any(first != second)
    assert mitt.gym.CatchEnv().render() is None


@pytest.mark.parametrize("size", [(480, 360), (200, 500)])
@pytest.mark.parametrize("kind", [mitt.gym.CatchEnv, mitt.gym.MeetEnv, mitt.gym.BatEnv])
def test_the_arm_and_what_comes_are_in_the_picture(
    kind: Any,  # noqa: ANN401 (the classes of the tasks)
    size: tuple[int, int],
) -> None:
    """Whatever its shape: nothing that is to be seen is at the edge, and two sides are near it."""
    env = kind(render_mode="rgb_array", width=size[0], height=size[1])
    env.reset(seed=1)
    model, faces, view = env._prepared()
    for b in range(model.nbody):
        if model.body(b).name in ("world", "ball", "belt"):
            faces[b] = np.zeros((0, 3, 3)), np.zeros((0, 3))
    qpos = env.world.data.qpos.copy()
    qpos[: env.arm.n] = env.arm.model.q_ready
    ready = placed_faces(model, faces, qpos, np.zeros((0, 3)))[0]
    points = np.concatenate([ready.reshape(-1, 3), env._in_view()])
    at = view.pixels(points)[:, :2] / size
    assert np.all((at > 0.04) & (at < 0.96))
    assert np.any(at.max(axis=0) - at.min(axis=0) > 0.7)


@pytest.mark.parametrize("more", [{}, {"arm": "wam", "limits": "wam-48v"}, {"ticks": 37}])
@pytest.mark.parametrize("seed", [3, 4])
def test_actions_are_played_compiled_to_the_same_bytes(
    monkeypatch: pytest.MonkeyPatch, more: dict[str, Any], seed: int
) -> None:
    """Observations, rewards and what is said at the end are those of the loop in Python."""
    env, other = mitt.gym.CatchEnv(**more), mitt.gym.CatchEnv(**more)
    monkeypatch.setattr(other, "_plays_compiled", lambda: False)
    env.action_space.seed(seed)
    assert _same(env.reset(seed=seed)[0], other.reset(seed=seed)[0])
    assert env._compiled
    over = False
    while not over:
        action = env.action_space.sample()
        said, wanted = env.step(action), other.step(action)
        assert _same(said[0], wanted[0])
        assert said[1:] == wanted[1:]
        over = said[2] or said[3]
    assert np.array_equal(env.world.trace().qpos, other.world.trace().qpos)


@pytest.mark.parametrize("kind", [mitt.gym.CatchEnv, mitt.gym.MeetEnv, mitt.gym.BatEnv])
@pytest.mark.parametrize("action", ["torque", "residual"])
def test_each_number_has_a_name_a_unit_and_its_range(
    kind: Any,  # noqa: ANN401 (the classes of the tasks)
    action: str,
) -> None:
    """What stands in the tables of docs/gym.md is what the spaces are made of."""
    env = kind(action=action) if action == "torque" else kind(action=action, scene="ideal")
    for parts, space in (
        (env.observed(), env.observation_space),
        (env.acted(), env.action_space),
    ):
        assert isinstance(space, gymnasium.spaces.Box)
        assert [x.low for x in parts] == space.low.tolist()
        assert [x.high for x in parts] == space.high.tolist()
        assert len({(x.means, x.of) for x in parts}) == len(parts)
        assert all(x.unit in ("1", "rad", "m", "m/s") for x in parts)
    if action == "torque":
        page = (Path(__file__).parents[1] / "docs" / "gym.md").read_text(encoding="utf-8")
        for row in table_of(env.observed()) + table_of(env.acted()):
            assert row in page


def table_of(parts: tuple[mitt.gym.Component, ...]) -> list[str]:
    """Return the rows of a table, one for numbers that follow each other and are alike."""
    rows, k = list[str](), 0
    for (means, unit), group in groupby(parts, lambda x: (x.means, x.unit)):
        alike = list(group)
        last = k + len(alike) - 1
        which = f"{k}" if len(alike) == 1 else f"{k} to {last}"
        of = ", ".join(x.of for x in alike) or "-"
        rows.append(
            f"| {which} | {means} | {of} | {unit} | {alike[0].low:g} to {alike[0].high:g} |"
        )
        k = last + 1
    return rows


@pytest.mark.parametrize("policy", ["zero", "random"])
def test_an_evaluation_is_its_seeds(policy: str) -> None:
    """Twice the same, each episode by itself; the map earns more than what does nothing."""
    env = gymnasium.make("mitt/Catch-v0", scene="ideal", ticks=20)

    def plays() -> Any:  # noqa: ANN401 (a policy)
        return zero_policy(env) if policy == "zero" else random_policy(env, seed=5)

    one = mitt.gym.evaluate(env, plays(), episodes=3, seed=7)
    assert one == mitt.gym.evaluate(env, plays(), episodes=3, seed=7)
    assert one.seeds == (7, 8, 9)
    assert one.mean == pytest.approx(np.mean(one.returns))
    assert one.rate == 0.0
    assert one.ci95[0] == 0.0 < one.ci95[1] < 1.0
    if policy == "zero":
        last = mitt.gym.evaluate(env, plays(), episodes=1, seed=9)
        assert last.returns[0] == one.returns[2]
    best = gymnasium.make("mitt/Catch-v0", scene="ideal", ticks=20, action="residual")
    expert = mitt.gym.evaluate(best, mitt.gym.map_policy(best), episodes=2, seed=7)
    assert expert.rate == 1.0
    assert expert.mean > one.mean + 8.0


def test_what_is_no_environment_that_can_be_evaluated_is_refused() -> None:
    other = gymnasium.make("CartPole-v1")
    with pytest.raises(InputError, match="is_success"):
        mitt.gym.evaluate(other, lambda _: other.action_space.sample(), episodes=1)


def test_arms_and_scenes_by_keyword_and_what_is_refused() -> None:
    """Other limits and another scene are taken; what is none is one line."""
    env = gymnasium.make("mitt/Catch-v0", limits="wam-48v", scene="rough")
    env.reset(seed=1)
    assert mitt.gym.CatchEnv(arm="ur5e").arm.limits.name == "ur5e"
    for wrong in ({"action": "dance"}, {"scene": "no.toml"}, {"arm": "no"}, {"ticks": 0}):
        with pytest.raises(InputError):
            mitt.gym.CatchEnv(**wrong)
    with pytest.raises(InputError, match="finite"):
        env.unwrapped.step(np.full(4, np.nan, np.float32))
    with pytest.raises(InputError, match=r"mitt\.gym"):
        mitt.gym.map_policy(gymnasium.make("CartPole-v1"))


def test_an_arm_file_has_its_own_design_and_throws(tmp_path: Path) -> None:
    """The map as a baseline is the one of ``mitt catch``, and the balls come as the file says."""
    path = tmp_path / "arm.toml"
    path.write_text(
        f"""{BASKET_ARM}[throws]
speed = [5.8, 5.9]
"""
    )
    made = gymnasium.make("mitt/Catch-v0", arm=path, limits="wam-80v", action="residual")
    env: Any = made.unwrapped
    assert env.map.design.kappa == 1.777
    policy = mitt.gym.map_policy(env)
    caught = 0
    for seed in range(2):
        obs, _ = env.reset(seed=seed)
        assert 5.75 <= np.linalg.norm(obs[-3:]) <= 6.0
        over = False
        while not over:
            obs, _, terminated, truncated, info = env.step(policy(obs))
            over = terminated or truncated
        caught += info["status"] == "caught"
    assert caught == 2


@pytest.mark.parametrize("name", [*_IDS, "mitt/Meet-v0", "mitt/Bat-v0"])
def test_an_action_before_an_episode_is_refused_in_one_line(name: str) -> None:
    """Of the environment itself; Gymnasium's wrapper says so by an error of its own."""
    env = gymnasium.make(name).unwrapped
    with pytest.raises(InputError, match=r"step: wanted an environment that was.*reset first"):
        env.step(env.action_space.sample())
    env.reset(seed=1)
    env.step(np.zeros(env.action_space.shape or (), np.float32))
