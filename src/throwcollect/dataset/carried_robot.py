"""The robot in the directory of a dataset: files of its description, which lie there wherever they came from."""

from __future__ import annotations

import shutil
import tempfile
from pathlib import Path

from throwcollect.config.loader import dump_yaml
from throwcollect.config.robot_config import DescribedRobotConfig
from throwcollect.config.schema import Config
from throwcollect.dataset.directory import CONFIG, ROBOT
from throwcollect.files import write_file
from throwcollect.robots.imported import SRDF, URDF, list_files


def write_config(directory: Path, config: Config) -> None:
    """Write the configuration of a dataset, a model or an export, and the files of its robot beside it."""
    carry_robot(config, directory)
    write_file(directory / CONFIG, config_text(config).encode())


def config_text(config: Config) -> str:
    """Write the text of a configuration as it lies in a dataset, beside the files of its robot."""
    return dump_yaml(_place_robot(config, Path(ROBOT)))


def _place_robot(config: Config, directory: Path) -> Config:
    """Make a configuration whose robot has its files in a directory, if it is described by files."""
    robot = config.robot
    if not isinstance(robot, DescribedRobotConfig):
        return config
    place = {"urdf": str(directory / URDF), "srdf": str(directory / SRDF)}
    return config.model_copy(update={"robot": robot.model_copy(update=place)})


def carry_robot(config: Config, directory: Path) -> Config:
    """Copy the files of a robot into the directory of a dataset; return the configuration that names them there."""
    robot = config.robot
    if not isinstance(robot, DescribedRobotConfig):
        return config
    source, target = Path(robot.urdf).parent, directory / ROBOT
    if source != Path(ROBOT) and source.resolve() != target.resolve():
        scratch = Path(tempfile.mkdtemp(prefix=f".{ROBOT}-", dir=directory))
        try:
            for path in list_files(source):
                shutil.copyfile(path, scratch / path.name)
            shutil.rmtree(target, ignore_errors=True)
            scratch.chmod(0o755)
            scratch.rename(target)
        finally:
            shutil.rmtree(scratch, ignore_errors=True)
    return _place_robot(config, target)


def list_carried(directory: Path) -> list[str]:
    """List the files of the robot in a dataset, by their names there."""
    robot = directory / ROBOT
    return [f"{ROBOT}/{path.name}" for path in list_files(robot)] if robot.is_dir() else []
