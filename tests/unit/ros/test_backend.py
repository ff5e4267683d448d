"""Which backend nodes run on, and that both offer the same."""

import ast
import os
import subprocess
import sys
from importlib.util import find_spec
from pathlib import Path

import pytest

import throwcollect.ros
from throwcollect.errors import ConfigError
from throwcollect.ros.backend import VARIABLE, uses_rclpy


@pytest.fixture(autouse=True)
def _fresh():
    uses_rclpy.cache_clear()
    yield
    uses_rclpy.cache_clear()


def test_the_embedded_backend_can_be_asked_for(monkeypatch):
    monkeypatch.setenv(VARIABLE, "embedded")
    assert not uses_rclpy()


def test_rclpy_is_taken_where_it_can_be_imported(monkeypatch, tmp_path):
    (tmp_path / "rclpy").mkdir()
    (tmp_path / "rclpy" / "__init__.py").touch()
    monkeypatch.syspath_prepend(tmp_path)
    monkeypatch.delenv(VARIABLE, raising=False)
    assert uses_rclpy()
    uses_rclpy.cache_clear()
    monkeypatch.setenv(VARIABLE, "embedded")
    assert not uses_rclpy()


@pytest.mark.skipif(find_spec("rclpy") is not None, reason="rclpy is there")
def test_without_rclpy_the_embedded_backend_is_taken_unless_rclpy_is_asked_for(monkeypatch):
    monkeypatch.setenv(VARIABLE, "auto")
    assert not uses_rclpy()
    uses_rclpy.cache_clear()
    monkeypatch.setenv(VARIABLE, "rclpy")
    with pytest.raises(ConfigError, match="THROWCOLLECT_ROS is rclpy, but Python does not find it"):
        uses_rclpy()


def test_another_value_is_one_clear_message_and_exit_code_2(tmp_path):
    command = [sys.executable, "-m", "throwcollect", "up", "--runtime", "local", "--output", str(tmp_path / "data")]
    found = subprocess.run(command, env={**os.environ, VARIABLE: "ros2"}, capture_output=True, text=True, check=False)
    assert found.returncode == 2
    assert "THROWCOLLECT_ROS: got 'ros2'" in found.stderr
    assert "Traceback" not in found.stderr
    assert not (tmp_path / "data").exists()


def test_both_backends_offer_the_same_names():
    root = Path(throwcollect.ros.__file__).parent
    offered = {}
    for name in ("embedded/__init__.py", "genuine.py"):
        tree = ast.parse((root / name).read_text())
        bound = {
            alias.asname or alias.name for node in tree.body if isinstance(node, ast.ImportFrom) for alias in node.names
        } | {node.name for node in tree.body if isinstance(node, ast.FunctionDef)}
        (listed,) = [
            ast.literal_eval(node.value)
            for node in tree.body
            if isinstance(node, ast.Assign) and ast.unparse(node.targets[0]) == "__all__"
        ]
        assert set(listed) <= bound
        offered[name] = listed
    assert offered["embedded/__init__.py"] == offered["genuine.py"]
