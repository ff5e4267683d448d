"""Nodes in sessions of their own, connected by a real router."""

from tests.rclzenoh.conftest import endpoint, environment, rig

__all__ = ["endpoint", "environment", "rig"]
