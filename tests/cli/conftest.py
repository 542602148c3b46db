"""Files that the examples of the commands name."""

import shutil
from pathlib import Path

import cv2
import numpy as np
import pytest
from small_study import TEXT
from throws_on_film import calibrated

from mitt.core.map.learn import Learned
from mitt.io.maps import save_map
from mitt.io.rig import write_rig
from mitt.lab.trials.runs import simulate

ROOT = Path(__file__).parents[2]


@pytest.fixture(scope="package")
def files(tmp_path_factory: pytest.TempPathFactory, learned: Learned) -> Path:
    """A folder with the files that the examples name."""
    folder = tmp_path_factory.mktemp("examples")
    shutil.copy(ROOT / "examples" / "own_arm.urdf", folder / "ARM.urdf")
    arm = (ROOT / "examples" / "tutorials" / "arm" / "arm.toml").read_text()
    (folder / "ARM.toml").write_text(arm.replace("../../own_arm.urdf", "ARM.urdf"))
    save_map(folder / "MAP.json", learned, version="0")
    rows = [f"{0.002 * k:.3f},{3.0 - 0.01 * k:.3f},0.1,{0.3 + 0.005 * k:.3f}" for k in range(40)]
    (folder / "POINTS.csv").write_text("\n".join(["t_s,x_m,y_m,z_m", *rows]))
    rows = [f"a,{0.01 * k:.2f},0.6,{0.002 * k:.4f},0.3" for k in range(300)]
    (folder / "MOTIONS.csv").write_text("\n".join(["flight,t_s,x_m,y_m,z_m", *rows]))
    write_rig(folder / "RIG.toml", calibrated(), version="0")
    (folder / "STUDY.toml").write_text(TEXT)
    (folder / "CELL.toml").write_text(
        'schema = "mitt.cell/1"\nname = "guarded"\n[arm]\nfile = "wam"\n[robot.options]\n'
        'command = "/arm/commands"\nguard = "/guarded/commands"\nunbraked = true\n'
    )
    head = "x_m,y_m,z_m,u_left_px,v_left_px,u_right_px,v_right_px"
    (folder / "HAND.csv").write_text("\n".join([head, *["0.7,0.1,0.3,60,60,64,60"] * 12]))
    for name in ("LEFT", "RIGHT"):
        (folder / name).mkdir()
        (folder / f"{name}.mkv").write_bytes(b"")
        cv2.imwrite(str(folder / name / "0.png"), np.zeros((128, 128), np.uint8))
    simulate(learned, throws=1, pixels=False, record=folder)
    (folder / "throw-00000.mcap").rename(folder / "REC.mcap")
    return folder
