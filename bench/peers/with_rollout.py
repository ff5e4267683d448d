"""`mujoco.rollout` in threads, with position actuators and contacts of MuJoCo; the files of the robot are robosuite's.

All trials of a rollout have as many steps, so trials of about the same length are rolled out together.
"""

from __future__ import annotations

from importlib.util import find_spec
from pathlib import Path

import harness
import mujoco
import numpy as np
from mujoco import rollout

_STIFFNESS, _DAMPING = 2e4, 4e2
_OPEN = 0.04, -0.04
_TOGETHER = 16


def make_model():
    """Make a Panda with a gripper, and a ball above a floor."""
    # Importing robosuite would need the packages that its environments need.
    assets = Path(find_spec("robosuite").origin).parent / "models" / "assets"
    spec = mujoco.MjSpec.from_file(str(assets / "robots/panda/robot.xml"))
    hand = mujoco.MjSpec.from_file(str(assets / "grippers/panda_gripper.xml"))
    spec.body("right_hand").add_frame().attach_body(hand.worldbody.first_body(), "hand/", "")
    spec.body("base").pos = 0, 0, harness.BASE_HEIGHT_M
    for motor in spec.actuators[:7]:
        motor.set_to_position(kp=_STIFFNESS, kv=_DAMPING)
        motor.ctrllimited = False
    spec.worldbody.add_geom(type=mujoco.mjtGeom.mjGEOM_PLANE, size=(0, 0, 1))
    ball = spec.worldbody.add_body(name="ball")
    ball.add_freejoint(name="ball")
    ball.add_geom(type=mujoco.mjtGeom.mjGEOM_SPHERE, size=(harness.BALL_RADIUS_M, 0, 0), mass=harness.BALL_KG)
    spec.option.timestep = 1 / harness.PHYSICS_HZ
    spec.option.integrator = mujoco.mjtIntegrator.mjINT_IMPLICITFAST
    return spec.compile()


def make_run(threads):
    model = make_model()
    workers = [mujoco.MjData(model) for _ in range(threads)]
    pool = rollout.Rollout(nthread=threads if threads > 1 else 0)
    data = mujoco.MjData(model)

    def begin(start):
        mujoco.mj_resetData(model, data)
        data.qpos[:9] = [*start, harness.BALL_RADIUS_M, -harness.BALL_RADIUS_M]
        mujoco.mj_forward(model, data)
        data.joint("ball").qpos[:3] = data.site("hand/grip_site").xpos
        state = np.empty(mujoco.mj_stateSize(model, mujoco.mjtState.mjSTATE_FULLPHYSICS))
        mujoco.mj_getState(model, data, state, mujoco.mjtState.mjSTATE_FULLPHYSICS)
        return state

    def together(trials):
        steps = max(len(trial.positions) for trial in trials) - 1
        control = np.zeros((len(trials), steps, model.nu))
        for row, trial in zip(control, trials, strict=True):
            # A servo that also damps lags behind, but for this.
            ahead = np.diff(trial.positions, axis=0) * harness.PHYSICS_HZ * _DAMPING / _STIFFNESS
            row[: len(ahead), :7] = trial.positions[1:] + ahead
            row[len(ahead) :, :7] = trial.positions[-1]
            row[trial.release :, 7:] = _OPEN
        begun = np.array([begin(trial.positions[0]) for trial in trials])
        states = pool.rollout(model, workers, begun, control)[0]
        samples = states[:, harness.STRIDE - 1 :: harness.STRIDE, 1:]
        qpos, qvel = samples[..., : model.nq], samples[..., model.nq : model.nq + model.nv]
        rows = np.concatenate([qpos[..., :7], qvel[..., :7], qpos[..., 9:], qvel[..., 9:]], axis=-1)
        return [row[: len(trial.positions) // harness.STRIDE] for row, trial in zip(rows, trials, strict=True)]

    def run(trials):
        order = sorted(range(len(trials)), key=lambda number: len(trials[number].positions))
        found = {}
        for first in range(0, len(order), _TOGETHER):
            numbers = order[first : first + _TOGETHER]
            found |= zip(numbers, together([trials[number] for number in numbers]), strict=True)
        return [found[number] for number in range(len(trials))]

    return run


if __name__ == "__main__":
    harness.main(make_run, in_threads=True)
