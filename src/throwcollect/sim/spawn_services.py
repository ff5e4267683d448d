"""Services that put new entities into the world, and that list the descriptions that can be spawned."""

from __future__ import annotations

import re
from itertools import count

from throwcollect.errors import RequestError
from throwcollect.robots.description import robot_of
from throwcollect.ros import Node
from throwcollect.ros.msg import Resource, Result, Spawnable, SpawnResult
from throwcollect.ros.msg import SpawnEntity as SpawnWish
from throwcollect.ros.srv import GetSpawnables, SpawnEntities, SpawnEntity
from throwcollect.sim.body_messages import body_state
from throwcollect.sim.entities import WORLD_FRAME
from throwcollect.sim.resources import find_resources, load_model
from throwcollect.sim.service_results import offer, refusal
from throwcollect.sim.simulation import Simulation

_MOST_REQUESTS = 200
_MOST_SOURCES = 100
_LONGEST_NAME = 100
_NAME = re.compile(rf"[A-Za-z0-9_][A-Za-z0-9_.-]{{0,{_LONGEST_NAME - 1}}}")
_NAMESPACE = re.compile(r"/?[A-Za-z_][A-Za-z0-9_]*(/[A-Za-z_][A-Za-z0-9_]*)*|/?")
_LONGEST_NAMESPACE = 245
"""The limit of rmw."""


class SpawnServices:
    """Offers the services under relative names, so that they stand in the simulation's namespace."""

    def __init__(self, node: Node, simulation: Simulation) -> None:
        self._trial = simulation.trial
        self._entities = simulation.entities
        self._robot = robot_of(simulation.config)
        offer(node, SpawnEntity, "spawn_entity", self._spawn_one)
        offer(node, SpawnEntities, "spawn_entities", self._spawn_all)
        offer(node, GetSpawnables, "get_spawnables", self._list_spawnables)

    def _spawn_one(self, request: SpawnEntity.Request, response: SpawnEntity.Response) -> None:
        self._trial.require_free()
        response.entity_name = self._spawn(request, request)

    def _spawn_all(self, request: SpawnEntities.Request, response: SpawnEntities.Response) -> None:
        self._trial.require_free()
        if len(request.spawn_requests) > _MOST_REQUESTS:
            message = f"{len(request.spawn_requests)} requests in one call; at most {_MOST_REQUESTS}"
            raise RequestError("RESULT_OPERATION_FAILED", message)
        results = []
        for wish in request.spawn_requests:
            try:
                result = SpawnResult(entity_name=self._spawn(wish, wish.entity_resource))
                result.result.result = Result.RESULT_OK
            except RequestError as error:
                result = refusal(SpawnResult, error)
            results.append(result)
        response.results = results
        failed = sum(result.result.result != Result.RESULT_OK for result in results)
        if failed:
            response.result.result = SpawnEntities.Response.ENTITIES_SPAWN_FAILED
            response.result.error_message = f"{failed} of {len(results)} entities were not spawned; see their results"

    def _spawn(self, wish: SpawnWish | SpawnEntity.Request, resource: Resource | SpawnEntity.Request) -> str:
        """Put a new entity into the world and return its name; a request that cannot be met changes nothing."""
        if wish.name or not wish.allow_renaming:
            self._check_name(wish.name, allow_renaming=wish.allow_renaming)
        if len(wish.entity_namespace) > _LONGEST_NAMESPACE or not _NAMESPACE.fullmatch(wish.entity_namespace):
            message = f"namespace {wish.entity_namespace!r:.80}"
            raise RequestError("NAMESPACE_INVALID", message, expected="such as /left/table, or nothing")
        start = self._entities.in_world(body_state(wish.initial_pose.pose), wish.initial_pose.header.frame_id)
        model = load_model(resource.uri, resource.resource_string, self._robot)
        name = self._find_free_name(wish.name or model.name)
        origin = f"URDF {model.name!r:.80}" + (f" of {resource.uri:.500}" if resource.uri else "")
        namespace = f", namespace {wish.entity_namespace}" if wish.entity_namespace else ""
        self._entities.add(name, model, start, origin + namespace)
        return name

    def _check_name(self, name: str, *, allow_renaming: bool) -> None:
        if not _NAME.fullmatch(name) or name == WORLD_FRAME:
            raise RequestError(
                "NAME_INVALID",
                f"name {name!r:.120}",
                expected=f"1 to {_LONGEST_NAME} letters, digits and _ . -, beginning with neither . nor -, other than "
                f"{WORLD_FRAME}",
                hint=None if name else "allow_renaming, and the name of the description is taken",
            )
        if name in self._entities.names and not allow_renaming:
            raise RequestError("NAME_NOT_UNIQUE", f"there is an entity {name!r}", hint="allow_renaming")

    def _find_free_name(self, wish: str) -> str:
        """Find a name that no entity has: the wanted name, or the wanted name with a number."""
        stem = re.sub(r"[^A-Za-z0-9_]", "_", wish[:_LONGEST_NAME]) if not _NAME.fullmatch(wish) else wish
        stem = stem or "entity"
        taken = {WORLD_FRAME, *self._entities.names}
        if stem not in taken:
            return stem
        # An underscore and three digits are enough, because there are at most 200 entities beside ball and robot.
        return next(name for number in count(1) if (name := f"{stem[: _LONGEST_NAME - 4]}_{number}") not in taken)

    def _list_spawnables(self, request: GetSpawnables.Request, response: GetSpawnables.Response) -> None:
        if len(request.sources) > _MOST_SOURCES:
            message = f"{len(request.sources)} sources in one call; at most {_MOST_SOURCES}"
            raise RequestError("RESULT_OPERATION_FAILED", message)
        names, useless = find_resources(request.sources, self._robot)
        response.spawnables = [Spawnable(uri=uri, description=name) for uri, name in sorted(names.items())]
        response.result.error_message = "\n".join(useless)
