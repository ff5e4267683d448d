"""Offers the services of simulation_interfaces by which clients put bodies into a world, and take them out again."""

from __future__ import annotations

import re
from itertools import count

from throwcollect.engines.engine import GROUND, SceneBody
from throwcollect.errors import ConfigError, RequestError
from throwcollect.robots.body_files import place_spawned, read_spawned
from throwcollect.robots.description import robot_of
from throwcollect.robots.surroundings import bodies_of
from throwcollect.robots.tools.tool import tool_of
from throwcollect.ros import Node
from throwcollect.ros.msg import EntityState, Spawnable
from throwcollect.ros.nodes.simulation.control import offer, read_state
from throwcollect.ros.srv import DeleteEntity, GetSpawnables, SpawnEntity
from throwcollect.sim.live import LiveSimulator

_NAME = re.compile(r"[a-z][a-z0-9_]{0,31}")


class SpawningServices:
    """Offers the services under relative names, so that they stand in the simulation's namespace."""

    def __init__(self, node: Node, simulation: LiveSimulator) -> None:
        self._simulation = simulation
        self._bodies = {body.link.name: body for body in bodies_of(simulation.config)}
        offer(node, GetSpawnables, "get_spawnables", self._list)
        offer(node, SpawnEntity, "spawn_entity", self._spawn)
        offer(node, DeleteEntity, "delete_entity", self._delete)

    def _list(self, _request: GetSpawnables.Request, response: GetSpawnables.Response) -> None:
        about = "a copy of this body of the scene"
        response.spawnables = [Spawnable(uri=name, description=about) for name in self._bodies]

    def _spawn(self, request: SpawnEntity.Request, response: SpawnEntity.Response) -> None:
        self._simulation.trial.require_free()
        if request.entity_namespace:
            raise RequestError("NAMESPACE_INVALID", "bodies have no namespaces", expected="none")
        body, pose = self._read_resource(request), request.initial_pose
        at = read_state(EntityState(header=pose.header, pose=pose.pose))
        response.entity_name = self._choose_name(request)
        self._simulation.spawn(place_spawned(body, response.entity_name, at))

    def _delete(self, request: DeleteEntity.Request, _response: DeleteEntity.Response) -> None:
        if request.entity in self._simulation.spawned:
            self._simulation.remove_spawned([request.entity])
        elif request.entity in (*self._simulation.world.bodies, self._simulation.config.robot.name):
            raise RequestError("RESULT_OPERATION_FAILED", f"{request.entity} belongs to the scene")
        else:
            raise RequestError("RESULT_NOT_FOUND", f"no entity {request.entity!r:.80}")

    def _read_resource(self, request: SpawnEntity.Request) -> SceneBody:
        if request.uri:
            if request.uri not in self._bodies:
                known = ", ".join(self._bodies) or "none"
                raise RequestError("NO_RESOURCE", f"no body {request.uri!r:.80} in the scene; known: {known}")
            return self._bodies[request.uri]
        if not request.resource_string:
            raise RequestError("NO_RESOURCE", "neither uri nor resource_string", expected="a URDF as resource_string")
        try:
            return read_spawned(request.resource_string)
        except ConfigError as error:
            raise RequestError("RESOURCE_PARSE_ERROR", str(error)) from error

    def _choose_name(self, request: SpawnEntity.Request) -> str:
        """Choose the name of a new body: the one that is asked for, or with a number if it is taken."""
        name = request.name or (request.uri or "body" if request.allow_renaming else "")
        if not _NAME.fullmatch(name):
            expected = "up to 32 lower-case letters, digits and _, first a letter"
            raise RequestError("NAME_INVALID", f"name {name!r:.80}", expected=expected)
        robot, tool = robot_of(self._simulation.config), tool_of(self._simulation.config)
        things = (robot.name, *robot.description.links, tool.name, tool.link, GROUND)
        taken = {*things, *self._simulation.world.bodies}
        if name not in taken:
            return name
        if not request.allow_renaming:
            raise RequestError("NAME_NOT_UNIQUE", f"there is {name} already")
        return next(each for number in count(1) if (each := f"{name[:28]}_{number}") not in taken)
