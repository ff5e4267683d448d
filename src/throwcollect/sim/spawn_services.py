"""Services that put new entities into the world, and that tell what there is to put."""

from __future__ import annotations

from throwcollect.errors import RequestError
from throwcollect.robots.description import robot_of
from throwcollect.ros import Node
from throwcollect.ros.msg import Resource, Result, Spawnable, SpawnResult
from throwcollect.ros.msg import SpawnEntity as SpawnWish
from throwcollect.ros.srv import GetSpawnables, SpawnEntities, SpawnEntity
from throwcollect.sim.body_messages import body_state
from throwcollect.sim.resources import find_resources
from throwcollect.sim.service_results import answering, refusal
from throwcollect.sim.simulation import Simulation
from throwcollect.sim.spawning import SpawnRequest, spawn

_MOST_REQUESTS = 200
_MOST_SOURCES = 100


class SpawnServices:
    """Offers the services under relative names, so that they stand in the simulation's namespace.

    Args:
        node: The simulation's node.
        simulation: Where to put entities.
    """

    def __init__(self, node: Node, simulation: Simulation) -> None:
        self._simulation = simulation
        self._entities = simulation.entities
        self._robot = robot_of(simulation.config)
        for service, name, fill in (
            (SpawnEntity, "spawn_entity", self._spawn_one),
            (SpawnEntities, "spawn_entities", self._spawn_all),
            (GetSpawnables, "get_spawnables", self._list_spawnables),
        ):
            node.create_service(service, name, answering(service, fill))

    def _spawn_one(self, request: SpawnEntity.Request, response: SpawnEntity.Response) -> None:
        self._simulation.trial.require_free()
        response.entity_name = self._spawn(request, request)

    def _spawn_all(self, request: SpawnEntities.Request, response: SpawnEntities.Response) -> None:
        self._simulation.trial.require_free()
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
        pose = wish.initial_pose
        return spawn(
            self._entities,
            SpawnRequest(
                name=wish.name,
                allow_renaming=bool(wish.allow_renaming),
                uri=resource.uri,
                text=resource.resource_string,
                namespace=wish.entity_namespace,
                start=body_state(pose.pose),
                frame=pose.header.frame_id,
            ),
            self._robot,
        )

    def _list_spawnables(self, request: GetSpawnables.Request, response: GetSpawnables.Response) -> None:
        if len(request.sources) > _MOST_SOURCES:
            message = f"{len(request.sources)} sources in one call; at most {_MOST_SOURCES}"
            raise RequestError("RESULT_OPERATION_FAILED", message)
        resources, useless = find_resources(request.sources, self._robot)
        response.spawnables = [Spawnable(uri=resource.uri, description=resource.name) for resource in resources]
        response.result.error_message = "\n".join(useless)
