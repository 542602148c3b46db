"""A right value for every parameter of everything public."""

import inspect
from collections.abc import Callable, Iterator, Mapping
from dataclasses import dataclass, fields, replace
from functools import partial
from pathlib import Path
from typing import Any, final

import numpy as np
import pyarrow as pa
from soak.examples import ball_of

import mitt
import mitt.gym
from mitt.core.ball.filter import BallFilter, FilterConfig
from mitt.core.catcher.catcher import Catcher
from mitt.core.catcher.generators import Direct
from mitt.core.catcher.settings import CatcherSettings
from mitt.core.control.stop import plan_brake
from mitt.core.eyes.camera import fixed_rig
from mitt.core.eyes.eyes import Eyes, EyesConfig
from mitt.core.map.demand import Tolerance
from mitt.core.map.learn import Flight, Learned, LearnSettings
from mitt.core.map.mapping import unlearned
from mitt.core.map.neighbourhood import Neighbourhood
from mitt.core.signals import ArmState, BeltReading, Frame, Senses, Sighting
from mitt.gym.policies import zero_policy
from mitt.io.about import About
from mitt.io.cell import read_cell
from mitt.io.load import described
from mitt.io.maps import save_map
from mitt.lab.trials.meet_study import MeetStudySettings
from mitt.lab.world.scene import Scene, read_scene
from mitt.robot.cell.recorder import Recorder
from surface import names

URDF = names.ROOT / "examples" / "own_arm.urdf"
#: Joints of a UR5e, which meets parts.
UR5E = [
    "shoulder_pan_joint",
    "shoulder_lift_joint",
    "elbow_joint",
    "wrist_1_joint",
    "wrist_2_joint",
    "wrist_3_joint",
]

#: Settings of which an infinite number says that there is no bound.
_ENDLESS = frozenset(
    ("sigma_ready", "adapt_q", "adapt_dq", "tolerance", "max_tracking_error", "max_speed_share")
)
#: What mitt hands out and nobody makes; what is public of them is what they say.
RESULTS = frozenset(
    (
        "Learned",
        "Step",
        "Verdict",
        "Tick",
        "Trial",
        "Brake",
        "Command",
        "JointReference",
        "gym.Environment",
        "gym.Component",
        "gym.PolicyReturns",
    )
)


@dataclass(frozen=True, slots=True, repr=False)
class Case:
    """A public call that is right.

    Attributes:
        call: What is called.
        right: Values of all its parameters.
        slow: Whether the right call takes long: only what has to be refused is tried.
        measured: Parameters that come from sensors: a number that is none is a fault of theirs,
            and answered, not refused.
        endless: Parameters for which an infinite number means that there is no bound.
        ignored: Parameters that it has because others of its kind do.
        converts: Whether values are converted, as those of a file are.
    """

    call: Callable[..., Any]
    right: dict[str, Any]
    slow: bool = False
    measured: frozenset[str] = frozenset()
    endless: frozenset[str] = frozenset()
    ignored: frozenset[str] = frozenset()
    converts: bool = False

    def answers(self, key: str, value: object) -> bool:
        """Say whether a value that is refused elsewhere may be answered here."""
        if key in self.ignored:
            return isinstance(value, type(self.right[key]))
        if key not in self.measured | self.endless:
            return False
        numbers = isinstance(value, float) or (
            isinstance(value, np.ndarray)
            and value.dtype.kind == "f"
            and value.shape == np.shape(self.right[key])
        )
        return numbers and (key in self.measured or not np.isnan(np.asarray(value)).any())


def _read(reader: Callable[..., Any], rest: dict[str, Any], **given: Any) -> Any:  # noqa: ANN401
    """Call a reader; one that yields rows is read to its end."""
    answer = reader(**given, **rest)
    return list(answer) if isinstance(answer, Iterator) else answer


@final
class Cases:
    """The cases, by the name of what is called; built once, as an arm and a map take a second."""

    def __init__(self, folder: Path) -> None:
        """Build what is asked, and files in a folder."""
        self.folder = folder
        self.arm = arm = mitt.load_arm("wam", limits="paper")
        f = unlearned(arm, mitt.MapDesign())
        self.f = f = replace(f, region=np.array([arm.q_ready - 0.5, arm.q_ready + 0.5]))
        self.other = unlearned(
            mitt.load_arm("wam", joints=["j1", "j2", "j3", "j4"]),
            mitt.MapDesign(catch_joint=3, free=(0, 1, 3)),
        )
        self.direct, self.eyes = Direct(f), Eyes(fixed_rig())
        self.settings = CatcherSettings()
        self.catcher = Catcher(arm, self.direct, self.eyes, settings=self.settings)
        self.learned = Learned(map=f, maps=(f,), steps=(), flights=3, left_out=0, status="steps")
        save_map(folder / "map.json", self.learned, version=mitt.__version__)
        self.ball, self.q = ball_of(), arm.q_ready.copy()
        self.still = np.zeros((3, arm.n))
        self.still[0] = arm.q_ready
        self.senses = Senses(t=0.25, arm=ArmState(t=0.25, q=self.q, dq=self.still[1]))
        grey = np.zeros((128, 128), np.uint8)
        self.frames = tuple(Frame(t=0.0, camera=k, number=0, pixels=grey) for k in range(2))
        rows = np.array([[self.ball.r_o, self.ball.dr_o, self.ball.ddr_o]])
        self.flight = Flight(t=np.zeros(1), ball=rows, seen=rows[0])
        self.about = About(
            arm=arm,
            generator="direct",
            maps=(f,),
            settings=self.settings,
            rig=fixed_rig(),
            eyes=EyesConfig(),
        )
        self.all = (
            self._arms()
            | self._maps()
            | self._flows()
            | self._settings()
            | self._catching()
            | self._worlds()
            | self._readers()
        )

    def _arms(self) -> dict[str, Case]:
        """Return the cases of arms."""
        arm, q, x = self.arm, self.q, np.ones(len(self.arm.model.links))
        loads = {
            "name_or_path": URDF,
            "tip": "palm",
            "joints": ["yaw", "pitch", "elbow"],
            "held": {"lift": 0.0},
            "ready": [0.0, 0.1, 0.2],
            "limits": "model",
            "hand": "three-finger",
            "hand_turn": 0.5,
            "hand_mount": "plate",
            "encoder_step": 1e-4,
        }
        one = {"q": q}
        three = {"q": q, "dq": 0.0 * q, "ddq": 0.0 * q}
        motion = np.array([self.still])
        methods = {
            "active": {"x": x},
            "all_joints": {"x": q},
            "by_joint": {"share": x},
            "holding": {"mass": 0.125},
            "inverse_dynamics": three,
            "jacobian": one,
            "mass_matrix": one,
            "orientation": one,
            "position": one,
            "torque": three,
            "torque_derivatives": three,
            "torques": {"motion": motion},
            "torques_and_slopes": {"motion": motion},
            "hand_along": {"motion": motion},
        }
        return (
            self._methods("Arm", arm, methods)
            | {
                "load_arm": Case(mitt.load_arm, loads),
                "Arm": Case(type(arm), {"model": arm.model, "limits": arm.limits}),
                "plan_brake": Case(plan_brake, {"arm": arm, "t": 0.25, "motion": self.still}),
            }
            | self._methods(
                "Brake",
                plan_brake(arm, 0.25, self.still),
                {"at": {"t": 0.5}, "over": {"t": 0.5}, "table": {"tick": 0.001}},
            )
        )

    def _maps(self) -> dict[str, Case]:
        """Return the cases of maps and of what learns and keeps them."""
        f, q, ball, r_o = self.f, self.q, self.ball, self.ball.r_o
        throw = {"ball": ball, "q": q, "dq": 0.0 * q}
        rows = self.flight.ball
        of_map = {
            "F": {"r_o": r_o},
            "adapt": throw,
            "adapted": throw,
            "bend": {"q": q},
            "catch_gap": {"r_o": r_o},
            "equals": {"other": f},
            "motion": {"ball": rows[0]},
            "motions": {"path": rows, "alpha": f.alpha},
            "on": {"arm": self.arm},
            "reference": {"ball": ball},
            "to_ball": {"q_o": q},
            "to_joints": {"r_o": r_o},
            "virtual": {"ball": rows[0]},
            "with_alpha": {"alpha": f.alpha},
        }
        one = {"ball": ball}
        of_direct = {
            "adapt": throw,
            "astray": one,
            "reference": one,
            "returns": one,
            "sharpness": one,
            "unsettled": {"ball": ball, "q": q},
            "wait": throw,
            "waiting": one,
            "verdict": throw,
            "on": {"arm": self.arm},
        }
        parts = {x.name: getattr(f, x.name) for x in fields(f)} | {"q_rest": self.q}
        learns = {
            "arm": self.arm,
            "design": f.design,
            "flights": [self.flight],
            "seed": 1,
            "around": Neighbourhood(),
            "settings": LearnSettings(),
        }
        saved = self.folder / "map.json"
        direct = {
            "map": f,
            "tolerance": Tolerance(),
            "refines": True,
            "learned": f,
            "certificate": self.direct.verdict(ball, q),
        }
        found = self._methods("DirectMap", f, of_map) | self._methods(
            "Direct", self.direct, of_direct
        )
        return found | {
            "learn": Case(mitt.learn, learns, slow=True),
            "DirectMap": Case(type(f), parts, endless=frozenset(("region",))),
            "Direct": Case(Direct, direct),
            "save_map": Case(
                save_map,
                {
                    "path": self.folder / "new.json",
                    "learned": self.learned,
                    "version": mitt.__version__,
                },
            ),
            "read_map": Case(names.public()["read_map"], {"path": saved, "arm": self.arm}),
        }

    def _flows(self) -> dict[str, Case]:
        """Return the cases of what flows from stage to stage."""
        q, ball, found = self.q, self.ball, {}
        covariance = 2.0**-20 * np.eye(3)
        right: dict[str, tuple[Any, dict[str, Any]]] = {
            "Frame": (
                Frame,
                {
                    "t": 0.25,
                    "camera": 0,
                    "number": 1,
                    "pan": 0.0,
                    "tilt": 0.0,
                    "pixels": self.frames[0].pixels,
                },
            ),
            "Sighting": (
                Sighting,
                {"t": 0.25, "found": True, "r_o": ball.r_o, "covariance": covariance},
            ),
            "BeltReading": (BeltReading, {"t": 0.25, "travel": 0.5}),
            "BallState": (mitt.BallState, {x.name: getattr(ball, x.name) for x in fields(ball)}),
            "ArmState": (ArmState, {"t": 0.25, "q": q, "dq": 0.0 * q}),
            "Senses": (
                Senses,
                {
                    "t": 0.25,
                    "arm": self.senses.arm,
                    "frames": self.frames,
                    "points": (Sighting(t=0.25, found=True, r_o=ball.r_o, covariance=covariance),),
                    "belt": (BeltReading(t=0.25, travel=0.5),),
                },
            ),
        }
        for name, (call, given) in right.items():
            found[name] = Case(call, given, measured=frozenset(given))
        ballistic = BallFilter()
        found["BallFilter"] = Case(BallFilter, {"config": FilterConfig()})
        seen = {
            "update": {"sighting": right["Senses"][1]["points"][0]},
            "state": {"t": 0.5},
            "lift": {"t": 0.5},
        }
        methods = self._methods("BallFilter", ballistic, seen)
        for name in ("BallFilter.state", "BallFilter.lift"):
            methods[name] = replace(methods[name], measured=frozenset(("t",)))
        return found | methods

    def _settings(self) -> dict[str, Case]:
        """Return the cases of settings: each field as it is if left out."""
        found = {}
        for name, value in names.public().items():
            if name.endswith(("Settings", "Config")) or name in (
                "Neighbourhood",
                "Surroundings",
                "MapDesign",
            ):
                usual = value()
                given = {x.name: getattr(usual, x.name) for x in fields(usual)}
                found[name] = Case(value, given, endless=_ENDLESS)
        scene, cell = Scene(), names.public()["Cell"]
        ships = read_cell("wam-sim")
        keys = {"schema_name": "schema"}
        of_cell = {keys.get(x, x): getattr(ships, x) for x in type(ships).model_fields}
        of_scene = {x: getattr(scene, x) for x in type(scene).model_fields}
        return found | {
            "Scene": Case(Scene, of_scene, converts=True),
            "Cell": Case(cell, of_cell, converts=True),
        }

    def _catching(self) -> dict[str, Case]:
        """Return the cases of the catcher, its eyes and its recorder."""
        ball, motion = self.ball, np.array([self.still])
        makes = {
            "arm": self.arm,
            "generator": self.direct,
            "eyes": self.eyes,
            "settings": self.settings,
        }
        of_catcher = {
            "again": {"generator": self.direct},
            "learn_background": {"views": [self.frames]},
            "move": {"motion": motion},
            "recover": {"checked": True},
            "step": {"senses": self.senses},
            "ticked": {"todo": 0, "since": 0.0},
            "take_over": {"torques": np.zeros(self.arm.n), "t": -0.002},
        }
        of_eyes = {
            "arrange": {"frames": self.frames},
            "gaze": {"ball": ball, "t": 0.25},
            "guide": {"ball": ball, "t": 0.25, "alone": False},
            "learn_background": {"views": [self.frames]},
            "step": {"frames": self.frames},
        }
        recorder = Recorder(self.folder / "first.mcap", self.about)
        command = self.catcher.step(self.senses)
        of_recorder = {
            "background": {"frames": self.frames},
            "call": {"name": "stop"},
            "clock": {"offset": -0.005},
            "note": {"text": "a note", "topic": "/events"},
            "torques": {"torques": np.zeros(self.arm.n)},
            "tick": {"senses": self.senses, "command": command, "result": self.catcher.result},
        }
        records = {
            "path": self.folder / "again.mcap",
            "about": self.about,
            "images": False,
            "metadata": {"a": "text"},
        }
        return (
            {
                "Catcher": Case(Catcher, makes),
                "Recorder": Case(Recorder, records, slow=True),
                "Eyes": Case(Eyes, {"rig": fixed_rig(), "config": EyesConfig()}),
            }
            | self._methods("Catcher", self.catcher, of_catcher)
            | self._methods("Eyes", self.eyes, of_eyes)
            | self._methods("Recorder", recorder, of_recorder)
        )

    def _worlds(self) -> dict[str, Case]:
        """Return the cases of simulation and of the environments."""
        env = mitt.gym.CatchEnv(scene="ideal", ticks=1)
        env.reset(seed=1)
        throws = {
            "f": self.f,
            "arm": self.arm,
            "throws": 1,
            "seed": 0,
            "scene": Scene(),
            "pixels": False,
            "raise_stopped": False,
            "record": self.folder / "records",
        }
        builds = {
            "render_mode": "rgb_array",
            "arm": self.arm,
            "limits": "paper",
            "scene": "ideal",
            "action": "torque",
            "map": self.f,
            "ticks": 1,
            "width": 32,
            "height": 24,
        }
        acts = {
            "as_action": {"tau": np.zeros(3), "hand": 0.5},
            "step": {"action": np.zeros(4)},
            "reset": {"seed": 1, "options": {}},
        }
        found = {
            "simulate": Case(mitt.simulate, throws, slow=True),
            "gym.map_policy": Case(mitt.gym.map_policy, {"env": env}),
            "gym.evaluate": Case(
                mitt.gym.evaluate,
                {
                    "env": env,
                    "policy": zero_policy(env),
                    "episodes": 1,
                    "seed": 1,
                    "progress": lambda *_: None,
                },
                slow=True,
            ),
        }
        for kind in ("gym.CatchEnv", "gym.CatchPixelsEnv"):
            found |= {kind: Case(names.public()[kind], builds, slow=True)}
            found |= self._methods(kind, env, acts)
        meets = {
            "render_mode": "rgb_array",
            "arm": described("ur5e"),
            "tip": "tool0",
            "joints": UR5E,
            "limits": "ur5e",
            "tool": "suction",
            "target": "belt",
            "speed": 0.3,
            "gripper_delay": 0.05,
            "scene": "ideal",
            "action": "torque",
            "ticks": 1,
            "width": 32,
            "height": 24,
        }
        found["gym.MeetEnv"] = Case(names.public()["gym.MeetEnv"], meets, slow=True)
        part = mitt.gym.MeetEnv(ticks=1)
        part.reset(seed=1)
        acts |= {"as_action": {"tau": np.zeros(6), "hand": 0.5}, "step": {"action": np.zeros(7)}}
        found |= self._methods("gym.MeetEnv", part, acts)
        bats = {
            "render_mode": "rgb_array",
            "arm": "wam",
            "limits": "wam-48v",
            "target": np.array((3.0, 0.0, 0.5)),
            "action": "torque",
            "ticks": 1,
            "scene": "ideal",
            "width": 32,
            "height": 24,
        }
        found["gym.BatEnv"] = Case(names.public()["gym.BatEnv"], bats, slow=True)
        ball = mitt.gym.BatEnv(ticks=1)
        ball.reset(seed=1)
        n = ball.arm.n
        acts |= {"as_action": {"tau": np.zeros(n), "hand": 0.5}, "step": {"action": np.zeros(n)}}
        return found | self._methods("gym.BatEnv", ball, acts)

    def _readers(self) -> dict[str, Case]:
        """Return the cases of what reads a file: the path alone, with one that is not there."""
        rest = {
            "board": None,
            "size": (1, 1),
            "columns": ("t_s",),
            "arm": self.arm,
            "others": (),
            "generators": ("direct",),
            "known": ("direct",),
            "names": ("index",),
            "filters": (("index", "==", "0"),),
            "root": "robot",
            "kind": Scene,
            "said": MeetStudySettings,
        }
        found = {"read_scene": Case(read_scene, {"source": "lab", "flights": False})}
        for name, (reader, path) in names.readers().items():
            taken = inspect.signature(reader).parameters.values()
            given = {x.name: rest[x.name] for x in taken if x.name != path and x.default is x.empty}
            if name.startswith("lab.trials.study_results.") and "columns" in given:
                given["columns"] = pa.schema([("index", pa.int64())])
            found[name] = Case(partial(_read, reader, given), {path: self.folder / "missing.toml"})
        return found

    def _methods(self, name: str, thing: object, of: Mapping[str, object]) -> dict[str, Case]:
        """Return the cases of an object's methods."""
        found: dict[str, Case] = {}
        for method, given in of.items():
            call: dict[str, Any] = given  # type: ignore[assignment]
            found[f"{name}.{method}"] = Case(
                getattr(thing, method),
                call,
                endless=frozenset(("x", "share")),
                ignored=frozenset(("options",)),
                measured=frozenset(("r_o", "path", "ball")) if name == "DirectMap" else frozenset(),
            )
        return found
