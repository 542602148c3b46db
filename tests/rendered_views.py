"""Images of a bright ball by MuJoCo's renderer; run as a script, as GL is chosen at import.

    MUJOCO_GL=egl python rendered.py VIEWS.npz IMAGES.npz

Views: ``balls`` (centre in the optical frame, then radius [m], shape (n, 4)), ``f_px`` [px] and
``fine`` pixels a side for each of the 128 of the camera. Images: ``images``, shape (n, k, k).
"""

import sys

import mujoco
import numpy as np

SIDE = 128


def scene(f_px: float, fine: int) -> mujoco.MjModel:
    """Return a camera at the origin, z backward, y up, before a bright ball that can be moved."""
    field = np.rad2deg(2.0 * np.arctan(0.5 * SIDE / f_px))
    k = SIDE * fine
    return mujoco.MjModel.from_xml_string(f"""
    <mujoco>
      <visual>
        <global offwidth="{k}" offheight="{k}"/>
        <quality offsamples="8" numslices="128" numstacks="128" shadowsize="0"/>
        <map znear="0.005" zfar="50"/>
        <headlight ambient="1 1 1" diffuse="0 0 0" specular="0 0 0"/>
      </visual>
      <statistic extent="1" center="0 0 0"/>
      <asset><material name="white" rgba="1 1 1 1" emission="1" specular="0"/></asset>
      <worldbody>
        <camera name="eye" fovy="{field}"/>
        <body mocap="true"><geom name="ball" type="sphere" size="1" material="white"/></body>
      </worldbody>
    </mujoco>""")


def main() -> None:
    """Render all views."""
    views = np.load(sys.argv[1])
    fine = int(views["fine"])
    model = scene(float(views["f_px"]), fine)
    data, images = mujoco.MjData(model), []
    with mujoco.Renderer(model, SIDE * fine, SIDE * fine) as renderer:
        for x, y, z, radius in views["balls"]:
            data.mocap_pos[0] = x, -y, -z
            model.geom_size[0] = model.geom_rbound[0] = radius
            mujoco.mj_forward(model, data)
            renderer.update_scene(data, "eye")
            images.append(renderer.render().mean(axis=2).astype(np.uint8))
    np.savez_compressed(sys.argv[2], images=np.array(images))


if __name__ == "__main__":
    main()
