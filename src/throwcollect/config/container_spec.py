"""What a container is made from that is no node of a run, but an instance of a component."""

from __future__ import annotations

from dataclasses import dataclass

from throwcollect.config.containers import NodeContainerConfig


@dataclass(frozen=True)
class ContainerSpec:
    """A container that the operator's catalogue describes.

    Attributes:
        image: Its image.
        command: What it runs; None for what the image says.
        section: What it gets besides.
    """

    image: str
    command: tuple[str, ...] | None
    section: NodeContainerConfig
