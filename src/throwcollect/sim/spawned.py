"""Bodies that clients have put into a world; they stay in it when it is loaded anew."""

from __future__ import annotations

from throwcollect.engines.body import BodyModel
from throwcollect.engines.engine import Bodies, BodyState, Engine
from throwcollect.errors import RequestError


class SpawnedBodies:
    """The bodies of an engine's world, by name, in the order in which they were spawned."""

    def __init__(self, engine: Engine) -> None:
        self._engine = engine
        self._spawned: dict[str, tuple[BodyModel, BodyState]] = {}

    def __contains__(self, name: str) -> bool:
        return name in self._spawned

    def __len__(self) -> int:
        return len(self._spawned)

    @property
    def names(self) -> tuple[str, ...]:
        """Names of the bodies."""
        return tuple(self._spawned)

    def add(self, name: str, model: BodyModel, start: BodyState) -> None:
        """Put a body into the world, under a name that no other body has; only the pose of `start` matters."""
        self._bodies.add(name, model, start)
        self._spawned[name] = model, start

    def remove(self, name: str) -> None:
        """Take a body out of the world."""
        del self._spawned[name]
        # The body is no longer in the world if loading the world anew has failed.
        if name in self._bodies:
            self._bodies.remove(name)

    def clear(self) -> None:
        """Take all bodies out of the world."""
        for name in self.names:
            self.remove(name)

    def load(self) -> None:
        """Put bodies that are missing from the world, because it was loaded anew, back to where they were spawned."""
        for name, (model, start) in self._spawned.items():
            if name not in self._bodies:
                self._bodies.add(name, model, start)

    def model(self, name: str) -> BodyModel:
        """Return the model of a body."""
        return self._spawned[name][0]

    def engine_bodies(self, name: str) -> Bodies:
        """Return the bodies of the engine, which include the one of this name."""
        if name not in self._bodies:
            raise RequestError("RESULT_INCORRECT_STATE", f"{name}: there is no world until a reset succeeds")
        return self._bodies

    @property
    def _bodies(self) -> Bodies:
        if self._engine.bodies is None:
            message = "the physics engine of this simulation (sim.engine) knows robot, ground and ball alone"
            raise RequestError("RESULT_FEATURE_UNSUPPORTED", message)
        return self._engine.bodies
