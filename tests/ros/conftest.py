"""Everything here needs genuine rclpy and runs wherever Python finds it."""

import os
from importlib.util import find_spec
from pathlib import Path

import pytest

HERE = Path(__file__).parent


def pytest_collection_modifyitems(items: list[pytest.Item]) -> None:
    missing = pytest.mark.skip(reason="rclpy cannot be imported")
    for item in items:
        if HERE in item.path.parents:
            item.add_marker(pytest.mark.ros)
            if find_spec("rclpy") is None:
                item.add_marker(missing)


@pytest.fixture(scope="session")
def zenoh_rmw() -> None:
    """Genuine and embedded nodes meet over Zenoh alone."""
    if os.environ.get("RMW_IMPLEMENTATION") != "rmw_zenoh_cpp":
        pytest.skip("RMW_IMPLEMENTATION is not rmw_zenoh_cpp")
