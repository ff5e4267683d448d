"""Where a ball stays in the still spoon, and which balls the moving spoon throws."""

from functools import cache

import numpy as np
import pinocchio
import pytest

from throwcollect.config.schema import Config
from throwcollect.episode.record import EpisodeHeader
from throwcollect.robots.description import joint_model, start_posture
from throwcollect.robots.dynamics import ToolMotion
from throwcollect.robots.talos import TALOS
from throwcollect.robots.tools.tool import tool_of
from throwcollect.sim.world import World
from throwcollect.tasks.task import task_of
from throwcollect.tasks.throw.throw_result import ThrowOutcome

START = Config().task.start


@cache
def talos():
    model = joint_model(TALOS)
    return model, model.createData()


def up_in_spoon(config):
    """Direction against gravity in the spoon at the start."""
    model, data = talos()
    configuration = pinocchio.neutral(model)
    for joint, angle in start_posture(config).items():
        configuration[model.idx_qs[model.getJointId(joint)]] = angle
    pinocchio.framesForwardKinematics(model, data, configuration)
    return data.oMf[model.getFrameId(TALOS.hand, pinocchio.BODY)].rotation[2]


@pytest.mark.parametrize(
    ("turned", "sections"),
    [
        ("arm_right_5_joint", {}),
        ("arm_right_4_joint", {"tool": {"cup_walls": 4}}),
        ("arm_right_5_joint", {"ball": {"radius_m": 0.04, "friction": 0.0}, "tool": {"cup_depth_m": 0.045}}),
    ],
)
def test_a_ball_stays_in_a_tilted_spoon_while_the_way_out_climbs(turned, sections):
    world = None
    seen = set()
    for angle in np.arange(0.0, 1.5, 0.02):
        start = {**START, turned: START[turned] + angle}
        config = Config.model_validate({**sections, "task": {"start": start}, "sim": {"settle_s": 0.0}})
        slope = tool_of(config).way_out(config.ball.radius_m, up_in_spoon(config))
        # One angle just before the ball is lost is tested, and one just after.
        side = "stays" if slope > 0 else "leaves"
        if side in seen or not (0.01 < slope < 0.04 or -0.08 < slope < -0.03):
            continue
        seen.add(side)
        world = world or World(config)
        world.reset(config)
        world.run(np.tile([start_posture(config)[joint] for joint in world.moving], (600, 1)), stop_at_end=False)
        held = world.contacts()[0].end_ns is None and len(world.contacts()) == 1
        assert held == (slope > 0)
    assert seen == {"stays", "leaves"}
    world.close()


def test_tool_motion_places_the_ball_where_the_physics_has_it():
    world = World(Config(sim={"settle_s": 0.0}))
    samples = world.samples()
    place = ToolMotion(Config()).place(samples.position[0])
    assert place == pytest.approx(samples.object_position[0], abs=1e-4)
    world.close()


@pytest.mark.parametrize(
    ("start", "outcome"),
    [({}, ThrowOutcome.LANDED), ({"arm_right_5_joint": 1.5}, ThrowOutcome.DROPPED)],
)
def test_a_ball_that_the_turned_spoon_does_not_hold_is_dropped(start, outcome, thrower):
    one = thrower(task={"start": {**START, **start}})
    samples = one.throw()
    header = EpisodeHeader(0, int(samples.stamps_ns[0]), "landed", one.world.contacts(), (), len(samples))
    result = task_of(one.config).judge(samples, header, task_of(one.config).trajectory())
    assert result.outcome is outcome
    assert result.landing is not None
