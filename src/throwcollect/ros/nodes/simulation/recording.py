"""Offers the service by which clients record what they do with a simulation into a dataset."""

from __future__ import annotations

from pathlib import Path
from typing import Any

from throwcollect.dataset.session import SessionDataset
from throwcollect.errors import RequestError, ThrowcollectError
from throwcollect.ros import Node, get_service
from throwcollect.sim.live import LiveSimulator

SetBool: Any = get_service("std_srvs/srv/SetBool")


class RecordService:
    """Offers ``record`` under a relative name: true begins an episode, and false ends it."""

    def __init__(self, node: Node, simulation: LiveSimulator, directory: Path) -> None:
        self._node, self._simulation = node, simulation
        self._directory = directory
        self._dataset: SessionDataset | None = None
        self._ended_as: str | ThrowcollectError | None = None
        """What the client that ends the last recording gets: that it is written, or why it is not."""
        node.create_service(SetBool, "record", self._answer)

    def follow_up(self) -> None:
        """Write a recording that has ended without a client."""
        if self._simulation.recording_ended:
            self._write()

    def _answer(self, request: Any, response: Any) -> Any:
        try:
            response.message = self._begin() if request.data else self._end()
            response.success = True
        except ThrowcollectError as error:
            response.success, response.message = False, str(error)
        return response

    def _begin(self) -> str:
        config = self._simulation.config
        # The directory is made, and kept from others, once it is needed.
        self._dataset = self._dataset or SessionDataset(self._directory, config, name=self._node.get_name())
        self._simulation.begin_recording()
        self._ended_as = None
        return f"records for at most {config.sim.max_trial_s:g} s into {self._directory}"

    def _end(self) -> str:
        if self._simulation.records:
            self._write()
        ended, self._ended_as = self._ended_as, None
        if ended is None:
            raise RequestError(
                "RESULT_INCORRECT_STATE", "nothing is recorded: no recording was begun, or a reset ended it"
            )
        if isinstance(ended, ThrowcollectError):
            raise ended
        return ended

    def _write(self) -> None:
        recorded = self._simulation.end_recording()
        if recorded is None or self._dataset is None:
            self._ended_as = RequestError("RESULT_INCORRECT_STATE", "nothing has moved, so nothing was written")
            return
        try:
            number, result = self._dataset.append(*recorded)
        except ThrowcollectError as error:
            self._ended_as = error
            self._node.get_logger().error(f"a recording is lost: {error}")
            return
        self._ended_as = f"trial {number}: {result.outcome.value}{f', {result.reason}' if result.reason else ''}"
        self._node.get_logger().info(f"recorded into {self._directory}: {self._ended_as}")
