"""Bodies that are added to a MuJoCo world: obstacles, tables, other robots."""

from __future__ import annotations

from collections.abc import Callable, Iterator
from dataclasses import dataclass

import mujoco

from throwcollect.engines.body import BodyModel
from throwcollect.engines.engine import Bodies, BodyState, Box
from throwcollect.engines.mujoco.rotations import rotation, turn, turn_back
from throwcollect.engines.mujoco.scenery import Surface, boxes, collide_with_everything, read_body, watch
from throwcollect.errors import RequestError

_FREE_JOINT = "free"


@dataclass
class _Added:
    """A body in the world.

    Attributes:
        model: Its model.
        links: Names of its links; the root link comes first.
        state: The state that it was last put into.
    """

    model: BodyModel
    links: list[str]
    state: BodyState


class MujocoBodies(Bodies):
    """The bodies of one world. Their joints are braked, with the efforts of their limits.

    MuJoCo compiles a world as a whole, so adding or removing a body compiles it again.

    Args:
        compile_world: Compiles the world with all bodies that are here, and keeps the motion of those that were there
            before. If MuJoCo refuses a body, it raises a `ValueError` and leaves the world as it is.
        world: Returns the compiled world.
    """

    def __init__(
        self,
        compile_world: Callable[[], None],
        world: Callable[[], tuple[mujoco.MjModel, mujoco.MjData]],
    ) -> None:
        self._compile_world, self._world = compile_world, world
        self._bodies: dict[str, _Added] = {}
        self.leave_traces = False
        """A body has been in the world since it was loaded."""

    def __contains__(self, name: object) -> bool:
        return name in self._bodies

    def forget(self) -> None:
        """Take note that the world was emptied."""
        self._bodies.clear()
        self.leave_traces = False

    def add(self, name: str, model: BodyModel, start: BodyState) -> None:
        """Put a body into the world; see `Bodies.add`."""
        if any(shape.is_concave for link in model.links for shape in link.shapes):
            raise RequestError(
                "RESOURCE_PARSE_ERROR",
                "MuJoCo would fill in the mesh of a body that is attached to the world",
                expected="boxes, spheres, cylinders and capsules, or sim.engine: bullet",
            )
        self._bodies[name] = _Added(model, [], start)
        try:
            self._compile_world()
        except ValueError as error:
            del self._bodies[name]
            raise RequestError("RESOURCE_PARSE_ERROR", f"the physics engine cannot load it: {error}") from error
        self.leave_traces = True
        self.place(name, start)

    def remove(self, name: str) -> None:
        """Take a body out of the world."""
        del self._bodies[name]
        self._compile_world()

    def attach(self, spec: mujoco.MjSpec) -> Iterator[Surface]:
        """Put all bodies into a world before it is compiled.

        Yields:
            The surfaces of these bodies, which can press on the ball.
        """
        for name, body in self._bodies.items():
            # MuJoCo gives names such as `world` a meaning, so links have their numbers for names.
            body.links = [link.name for link in body.model.links]
            child = read_body(body.model.rename_links({name: str(index) for index, name in enumerate(body.links)}))
            for joint in child.joints:
                # MuJoCo reads the effort limit of a URDF as a range of motor torques. Set as dry friction instead, it
                # brakes the joint.
                joint.frictionloss = max(joint.actfrcrange[1], 0.0)
                joint.actfrclimited = mujoco.mjtLimited.mjLIMITED_FALSE
            if not body.model.is_fixed:
                child.worldbody.first_body().add_freejoint(name=_FREE_JOINT)
            collide_with_everything(child)
            spec.attach(child, frame=spec.worldbody.add_frame(), prefix=f"{name}/")
            for number, link in enumerate(body.links):
                surface = Surface(f"{name}/{number}", f"{name}/{link}")
                watch(spec, surface)
                yield surface

    def place_fixed(self) -> None:
        """Put bodies that are attached to the world where they were last put: compiling the world has reset them."""
        for name, body in self._bodies.items():
            if body.model.is_fixed:
                self.place(name, body.state)

    def state(self, name: str) -> BodyState:
        """Find pose and velocity of the root link of a body."""
        body = self._bodies[name]
        if body.model.is_fixed:
            return body.state
        joint = self._world()[1].joint(f"{name}/{_FREE_JOINT}")
        # MuJoCo has the real part of a quaternion first, and the angular velocity of a free body in the frame of that
        # body.
        x, y, z, w, i, j, k = joint.qpos.tolist()
        vx, vy, vz, *spin = joint.qvel.tolist()
        return BodyState((x, y, z), (i, j, k, w), (vx, vy, vz), turn((i, j, k, w), spin))

    def place(self, name: str, state: BodyState) -> None:
        """Set pose and velocity of the root link of a body; its joints stay as they are."""
        body = self._bodies[name]
        model, data = self._world()
        x, y, z, w = state.orientation_xyzw
        body.state = BodyState(state.position, state.orientation_xyzw)
        if body.model.is_fixed:
            root = model.body(f"{name}/0")
            root.pos, root.quat = state.position, (w, x, y, z)
            return
        joint = data.joint(f"{name}/{_FREE_JOINT}")
        joint.qpos = (*state.position, w, x, y, z)
        joint.qvel = (*state.linear_velocity, *turn_back(state.orientation_xyzw, state.angular_velocity))

    def boxes(self, name: str) -> list[Box]:
        """Find the boxes around the links of a body, along the axes of the world."""
        model, data = self._world()
        # MuJoCo computes the poses of shapes at the beginning of a step, so those of now are not known yet.
        mujoco.mj_kinematics(model, data)
        return boxes(model, data, self._list_body_numbers(name))

    def bounds(self, name: str) -> list[Box]:
        """Find the boxes around the links of a body, along the axes of its root link."""
        model, data = self._world()
        mujoco.mj_kinematics(model, data)
        root = model.body(f"{name}/0").id
        frame = data.xpos[root], rotation(data.xquat[root])
        return boxes(model, data, self._list_body_numbers(name), frame)

    def _list_body_numbers(self, name: str) -> list[int]:
        """List MuJoCo's body number of each link of a body."""
        model, _ = self._world()
        return [model.body(f"{name}/{number}").id for number in range(len(self._bodies[name].links))]
