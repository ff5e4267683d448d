"""Native libraries of rclpy, pybullet, Pinocchio and Zenoh in one process, whichever is loaded first."""

import os
import subprocess
import sys

import pytest

from throwcollect.ros.middleware import Middleware

IMPORTS = {
    "rclpy": "import rclpy, rclpy.action, control_msgs.action, trajectory_msgs.msg",
    "pybullet": "import pybullet",
    "pinocchio": "import pinocchio",
    "zenoh": "import zenoh",
}
# Each comes first once, and before and after each other one.
ORDERS = [[*[*IMPORTS][first:], *[*IMPORTS][:first]] for first in range(len(IMPORTS))]
WORK = """
import os, numpy, pyarrow, scipy.linalg

assert pybullet.connect(pybullet.DIRECT) == 0
pybullet.setGravity(0, 0, -10)
shape = pybullet.createCollisionShape(pybullet.GEOM_SPHERE, radius=0.1)
ball = pybullet.createMultiBody(1, shape, basePosition=[0, 0, 1])
for _ in range(240):
    pybullet.stepSimulation()
assert pybullet.getBasePositionAndOrientation(ball)[0][2] < -3

from throwcollect.robots.talos import TALOS
model = pinocchio.buildModelFromUrdf(str(TALOS.urdf_path))
data = model.createData()
pinocchio.forwardKinematics(model, data, pinocchio.neutral(model))
assert numpy.isfinite(data.oMi[model.njoints - 1].translation).all()
assert numpy.allclose(scipy.linalg.inv(numpy.eye(300) * 2), numpy.eye(300) / 2)

with zenoh.open(zenoh.Config()) as session:
    heard = []
    listener = session.declare_subscriber("here", lambda sample: heard.append(sample.payload.to_bytes()))
    session.put("here", b"hello")
    import time
    for _ in range(100):
        if heard:
            break
        time.sleep(0.05)
    assert heard == [b"hello"]

rclpy.init()
node = rclpy.create_node("one_process", namespace=f"/process_{os.getpid()}")
Follow = control_msgs.action.FollowJointTrajectory
points = []

def execute(handle):
    points.extend(handle.request.trajectory.points)
    handle.succeed()
    return Follow.Result(error_string="reached")

server = rclpy.action.ActionServer(node, Follow, "follow", execute)
client = rclpy.action.ActionClient(node, Follow, "follow")
assert client.wait_for_server(30)
goal = Follow.Goal()
goal.trajectory.points = [trajectory_msgs.msg.JointTrajectoryPoint(positions=[1.0, 2.0])]
sent = client.send_goal_async(goal)
rclpy.spin_until_future_complete(node, sent, timeout_sec=10)
result = sent.result().get_result_async()
rclpy.spin_until_future_complete(node, result, timeout_sec=10)
assert result.result().result.error_string == "reached"
assert list(points[0].positions) == [1.0, 2.0]
rclpy.shutdown()
print("all of it works")
"""


@pytest.mark.parametrize("names", ORDERS, ids="-".join)
def test_all_native_libraries_work_in_one_process(names):
    program = "\n".join([*(IMPORTS[name] for name in names), WORK])
    found = subprocess.run(
        [sys.executable, "-c", program],
        env={**os.environ, "ROS_AUTOMATIC_DISCOVERY_RANGE": "LOCALHOST"},
        capture_output=True,
        text=True,
        timeout=120,
        check=False,
    )
    assert (found.returncode, found.stdout.splitlines()[-1:]) == (0, ["all of it works"]), found.stderr


SECOND_RUN = """
from pathlib import Path

from throwcollect import ros
from throwcollect.errors import WorkerError
from throwcollect.ros.connection import Connection
from throwcollect.ros.middleware import Middleware
from throwcollect.run_key import RunKey

def join(port):
    way = Connection(f"udp/127.0.0.1:{port}", RunKey(Path("nowhere")), 0, Middleware.of_process())
    context = ros.Context()
    ros.init(context=context, connection=way)
    return context

for _ in range(2):
    ros.shutdown(context=join(7411))
try:
    join(7412)
except WorkerError as error:
    print(error.message)
"""


@pytest.mark.skipif(not Middleware.of_process().is_fast_dds, reason="a discovery server is Fast DDS's")
def test_a_process_on_fast_dds_can_join_only_one_run():
    found = subprocess.run([sys.executable, "-c", SECOND_RUN], capture_output=True, text=True, timeout=60, check=False)
    said = (
        "this process is in the run at udp/127.0.0.1:7411, and on Fast DDS it cannot be in that at udp/127.0.0.1:7412"
    )
    assert (found.returncode, found.stdout.splitlines()[-1:]) == (0, [said]), found.stderr
