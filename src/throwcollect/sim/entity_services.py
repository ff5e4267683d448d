"""Services about the entities in the world: their names, states, bounds and descriptions."""

from __future__ import annotations

from throwcollect.ros import Node
from throwcollect.ros.msg import Bounds, EntityState, Vector3
from throwcollect.ros.srv import (
    DeleteEntity,
    GetEntities,
    GetEntitiesStates,
    GetEntityBounds,
    GetEntityInfo,
    GetEntityState,
    SetEntityInfo,
    SetEntityState,
)
from throwcollect.sim.body_messages import body_state, entity_state
from throwcollect.sim.entities import EntityInfo
from throwcollect.sim.entity_filter import select
from throwcollect.sim.service_results import offer
from throwcollect.sim.simulation import Simulation


class EntityServices:
    """Offers the services under relative names, so that they stand in the simulation's namespace."""

    def __init__(self, node: Node, simulation: Simulation) -> None:
        self._simulation = simulation
        self._entities = simulation.entities
        offer(node, GetEntities, "get_entities", self._list)
        offer(node, GetEntitiesStates, "get_entities_states", self._list_states)
        offer(node, GetEntityState, "get_entity_state", self._get_state)
        offer(node, SetEntityState, "set_entity_state", self._set_state)
        offer(node, GetEntityInfo, "get_entity_info", self._get_info)
        offer(node, SetEntityInfo, "set_entity_info", self._set_info)
        offer(node, GetEntityBounds, "get_entity_bounds", self._get_bounds)
        offer(node, DeleteEntity, "delete_entity", self._delete)

    def _list(self, request: GetEntities.Request, response: GetEntities.Response) -> None:
        response.entities = select(self._entities, request.filters)

    def _list_states(self, request: GetEntitiesStates.Request, response: GetEntitiesStates.Response) -> None:
        response.entities = select(self._entities, request.filters)
        response.states = [self._read_state(name) for name in response.entities]

    def _get_state(self, request: GetEntityState.Request, response: GetEntityState.Response) -> None:
        response.state = self._read_state(request.entity)

    def _read_state(self, name: str) -> EntityState:
        return entity_state(self._entities.state(name), self._simulation.now_ns)

    def _set_state(self, request: SetEntityState.Request, _response: SetEntityState.Response) -> None:
        self._simulation.trial.require_free()
        state, acceleration = request.state, request.state.acceleration
        accelerations = (acceleration.linear, acceleration.angular)
        self._entities.place(
            request.entity,
            body_state(state.pose, state.twist),
            frame=state.header.frame_id,
            accelerates=any((vector.x, vector.y, vector.z) != (0.0, 0.0, 0.0) for vector in accelerations),
        )

    def _get_info(self, request: GetEntityInfo.Request, response: GetEntityInfo.Response) -> None:
        info = self._entities.info(request.entity)
        response.info.category.category = info.category
        response.info.description = info.description
        response.info.tags = list(info.tags)

    def _set_info(self, request: SetEntityInfo.Request, _response: SetEntityInfo.Response) -> None:
        info = request.info
        self._entities.set_info(
            request.entity, EntityInfo(int(info.category.category), info.description, tuple(info.tags))
        )

    def _get_bounds(self, request: GetEntityBounds.Request, response: GetEntityBounds.Response) -> None:
        box = self._entities.bounds(request.entity)
        if box is not None:
            response.bounds.type = Bounds.TYPE_BOX
            # In simulation_interfaces/msg/Bounds the upper corner comes first.
            response.bounds.points = [Vector3(x=x, y=y, z=z) for x, y, z in reversed(box)]

    def _delete(self, request: DeleteEntity.Request, _response: DeleteEntity.Response) -> None:
        self._simulation.trial.require_free()
        self._entities.remove(request.entity)
