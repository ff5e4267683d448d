# Written by packaging/interface_stubs.py.
from dataclasses import dataclass
from typing import ClassVar

from rclzenoh.interfaces import msg
from rclzenoh.interfaces.lookup import Service
from rclzenoh.interfaces.message import Message

class CancelGoal(Service):
    @dataclass(kw_only=True, eq=False)
    class Request(Message):
        goal_info: msg.GoalInfo = ...
    @dataclass(kw_only=True, eq=False)
    class Response(Message):
        ERROR_NONE: ClassVar[int]
        ERROR_REJECTED: ClassVar[int]
        ERROR_UNKNOWN_GOAL_ID: ClassVar[int]
        ERROR_GOAL_TERMINATED: ClassVar[int]
        return_code: int = ...
        goals_canceling: list[msg.GoalInfo] = ...

class DeleteEntity(Service):
    @dataclass(kw_only=True, eq=False)
    class Request(Message):
        entity: str = ...
    @dataclass(kw_only=True, eq=False)
    class Response(Message):
        result: msg.Result = ...

class DescribeParameters(Service):
    @dataclass(kw_only=True, eq=False)
    class Request(Message):
        names: list[str] = ...
    @dataclass(kw_only=True, eq=False)
    class Response(Message):
        descriptors: list[msg.ParameterDescriptor] = ...

class GetEntities(Service):
    @dataclass(kw_only=True, eq=False)
    class Request(Message):
        filters: msg.EntityFilters = ...
    @dataclass(kw_only=True, eq=False)
    class Response(Message):
        result: msg.Result = ...
        entities: list[str] = ...

class GetEntitiesStates(Service):
    @dataclass(kw_only=True, eq=False)
    class Request(Message):
        filters: msg.EntityFilters = ...
    @dataclass(kw_only=True, eq=False)
    class Response(Message):
        result: msg.Result = ...
        entities: list[str] = ...
        states: list[msg.EntityState] = ...

class GetEntityBounds(Service):
    @dataclass(kw_only=True, eq=False)
    class Request(Message):
        entity: str = ...
    @dataclass(kw_only=True, eq=False)
    class Response(Message):
        result: msg.Result = ...
        bounds: msg.Bounds = ...

class GetEntityInfo(Service):
    @dataclass(kw_only=True, eq=False)
    class Request(Message):
        entity: str = ...
    @dataclass(kw_only=True, eq=False)
    class Response(Message):
        result: msg.Result = ...
        info: msg.EntityInfo = ...

class GetEntityState(Service):
    @dataclass(kw_only=True, eq=False)
    class Request(Message):
        entity: str = ...
    @dataclass(kw_only=True, eq=False)
    class Response(Message):
        result: msg.Result = ...
        state: msg.EntityState = ...

class GetParameterTypes(Service):
    @dataclass(kw_only=True, eq=False)
    class Request(Message):
        names: list[str] = ...
    @dataclass(kw_only=True, eq=False)
    class Response(Message):
        types: msg.Octets = ...

class GetParameters(Service):
    @dataclass(kw_only=True, eq=False)
    class Request(Message):
        names: list[str] = ...
    @dataclass(kw_only=True, eq=False)
    class Response(Message):
        values: list[msg.ParameterValue] = ...

class GetSimulationState(Service):
    @dataclass(kw_only=True, eq=False)
    class Request(Message): ...
    @dataclass(kw_only=True, eq=False)
    class Response(Message):
        state: msg.SimulationState = ...
        result: msg.Result = ...

class GetSimulatorFeatures(Service):
    @dataclass(kw_only=True, eq=False)
    class Request(Message): ...
    @dataclass(kw_only=True, eq=False)
    class Response(Message):
        features: msg.SimulatorFeatures = ...

class GetSpawnables(Service):
    @dataclass(kw_only=True, eq=False)
    class Request(Message):
        sources: list[str] = ...
    @dataclass(kw_only=True, eq=False)
    class Response(Message):
        result: msg.Result = ...
        spawnables: list[msg.Spawnable] = ...

class ListControllers(Service):
    @dataclass(kw_only=True, eq=False)
    class Request(Message): ...
    @dataclass(kw_only=True, eq=False)
    class Response(Message):
        controller: list[msg.ControllerState] = ...

class ListParameters(Service):
    @dataclass(kw_only=True, eq=False)
    class Request(Message):
        DEPTH_RECURSIVE: ClassVar[int]
        prefixes: list[str] = ...
        depth: int = ...
    @dataclass(kw_only=True, eq=False)
    class Response(Message):
        result: msg.ListParametersResult = ...

class QueryTrajectoryState(Service):
    @dataclass(kw_only=True, eq=False)
    class Request(Message):
        time: msg.Time = ...
    @dataclass(kw_only=True, eq=False)
    class Response(Message):
        success: bool = ...
        message: str = ...
        name: list[str] = ...
        position: msg.Floats = ...
        velocity: msg.Floats = ...
        acceleration: msg.Floats = ...

class ResetSimulation(Service):
    @dataclass(kw_only=True, eq=False)
    class Request(Message):
        SCOPE_DEFAULT: ClassVar[int]
        SCOPE_TIME: ClassVar[int]
        SCOPE_STATE: ClassVar[int]
        SCOPE_SPAWNED: ClassVar[int]
        SCOPE_ALL: ClassVar[int]
        scope: int = ...
    @dataclass(kw_only=True, eq=False)
    class Response(Message):
        result: msg.Result = ...

class SetEntityInfo(Service):
    @dataclass(kw_only=True, eq=False)
    class Request(Message):
        entity: str = ...
        info: msg.EntityInfo = ...
    @dataclass(kw_only=True, eq=False)
    class Response(Message):
        result: msg.Result = ...

class SetEntityState(Service):
    @dataclass(kw_only=True, eq=False)
    class Request(Message):
        entity: str = ...
        state: msg.EntityState = ...
    @dataclass(kw_only=True, eq=False)
    class Response(Message):
        INVALID_POSE: ClassVar[int]
        result: msg.Result = ...

class SetParameters(Service):
    @dataclass(kw_only=True, eq=False)
    class Request(Message):
        parameters: list[msg.Parameter] = ...
    @dataclass(kw_only=True, eq=False)
    class Response(Message):
        results: list[msg.SetParametersResult] = ...

class SetParametersAtomically(Service):
    @dataclass(kw_only=True, eq=False)
    class Request(Message):
        parameters: list[msg.Parameter] = ...
    @dataclass(kw_only=True, eq=False)
    class Response(Message):
        result: msg.SetParametersResult = ...

class SetSimulationState(Service):
    @dataclass(kw_only=True, eq=False)
    class Request(Message):
        state: msg.SimulationState = ...
    @dataclass(kw_only=True, eq=False)
    class Response(Message):
        ALREADY_IN_TARGET_STATE: ClassVar[int]
        STATE_TRANSITION_ERROR: ClassVar[int]
        INCORRECT_TRANSITION: ClassVar[int]
        result: msg.Result = ...

class SpawnEntities(Service):
    @dataclass(kw_only=True, eq=False)
    class Request(Message):
        spawn_requests: list[msg.SpawnEntity] = ...
    @dataclass(kw_only=True, eq=False)
    class Response(Message):
        ENTITIES_SPAWN_FAILED: ClassVar[int]
        result: msg.Result = ...
        results: list[msg.SpawnResult] = ...

class SpawnEntity(Service):
    @dataclass(kw_only=True, eq=False)
    class Request(Message):
        name: str = ...
        allow_renaming: bool = ...
        uri: str = ...
        resource_string: str = ...
        entity_namespace: str = ...
        initial_pose: msg.PoseStamped = ...
    @dataclass(kw_only=True, eq=False)
    class Response(Message):
        NAME_NOT_UNIQUE: ClassVar[int]
        NAME_INVALID: ClassVar[int]
        UNSUPPORTED_FORMAT: ClassVar[int]
        NO_RESOURCE: ClassVar[int]
        NAMESPACE_INVALID: ClassVar[int]
        RESOURCE_PARSE_ERROR: ClassVar[int]
        MISSING_ASSETS: ClassVar[int]
        UNSUPPORTED_ASSETS: ClassVar[int]
        INVALID_POSE: ClassVar[int]
        result: msg.Result = ...
        entity_name: str = ...

class StepSimulation(Service):
    @dataclass(kw_only=True, eq=False)
    class Request(Message):
        steps: int = ...
    @dataclass(kw_only=True, eq=False)
    class Response(Message):
        result: msg.Result = ...

