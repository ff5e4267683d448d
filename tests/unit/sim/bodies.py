"""Descriptions that tests spawn."""

import numpy as np

from throwcollect.engines.mesh import STL

UNIT_INERTIA = '<inertia ixx="1" iyy="1" izz="1" ixy="0" ixz="0" iyz="0"/>'


def box(size="0.2 0.2 0.2", *, mass=1.0, name="box", origin="0 0 0", inertia=UNIT_INERTIA):
    """URDF of one box; without a mass it is fixed to the world."""
    inertial = f'<inertial><origin xyz="{origin}"/><mass value="{mass}"/>{inertia}</inertial>' if mass else ""
    return f"""<robot name="{name}">
  <link name="body">
    {inertial}
    <collision><origin xyz="{origin}"/><geometry><box size="{size}"/></geometry></collision>
  </link>
</robot>"""


def pendulum(*, kind="revolute", limit='<limit lower="-1" upper="1" effort="0" velocity="9"/>', axis="0 1 0"):
    """URDF of a bar that hangs on a joint of a block that is fixed to the world."""
    return f"""<robot name="pendulum">
  <link name="world"/>
  <link name="block"><collision><geometry><sphere radius="0.05"/></geometry></collision></link>
  <link name="bar">
    <inertial><origin xyz="0.5 0 0"/><mass value="1"/>{UNIT_INERTIA}</inertial>
    <collision>
      <origin xyz="0.5 0 0" rpy="0 1.5707963 0"/><geometry><cylinder radius="0.02" length="1"/></geometry>
    </collision>
  </link>
  <joint name="foot" type="fixed"><parent link="world"/><child link="block"/></joint>
  <joint name="hinge" type="{kind}">
    <parent link="block"/><child link="bar"/><axis xyz="{axis}"/>{limit}
  </joint>
</robot>"""


def write_mesh(path, triangles):
    """Write triangles, shape ``(n, 3, 3)``, as binary STL; return the path."""
    records = np.zeros(len(triangles), STL)
    records["corners"] = triangles
    path.write_bytes(bytes(80) + len(records).to_bytes(4, "little") + records.tobytes())
    return path
