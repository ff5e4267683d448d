"""Copies the files of a described robot, motions, and shapes of bodies into a dataset, which needs no other files."""

from __future__ import annotations

import base64
import io
import shutil
import tempfile
import zipfile
from pathlib import Path

from throwcollect.config.loader import dump_yaml
from throwcollect.config.motion import MotionFile
from throwcollect.config.robot_config import DescribedRobotConfig
from throwcollect.config.scene import FileBodyConfig
from throwcollect.config.schema import BODIES, MOTIONS, Config
from throwcollect.dataset.directory import CONFIG, ROBOT
from throwcollect.files import write_file
from throwcollect.plan.parquet_file import encode_table
from throwcollect.robots.body_files import files_of
from throwcollect.robots.description import robot_of
from throwcollect.robots.imported import SRDF, URDF, list_files
from throwcollect.tasks.motions import motions_of


def write_config(directory: Path, config: Config) -> None:
    """Write the configuration of a dataset, and next to it the files that it names."""
    carry_robot(config, directory)
    write_file(directory / CONFIG, config_text(config).encode())


def config_text(config: Config) -> str:
    """Write a configuration as YAML as a dataset has it, which carries the files that it names."""
    return dump_yaml(_place_robot(config, Path(ROBOT)).with_files_in(Path()))


def _place_robot(config: Config, directory: Path) -> Config:
    """Make a configuration whose robot has its files in a directory, if it is described by files."""
    robot = config.robot
    if not isinstance(robot, DescribedRobotConfig):
        return config
    place = {"urdf": str(directory / URDF), "srdf": str(directory / SRDF)}
    return config.model_copy(update={"robot": robot.model_copy(update=place)})


def carry_robot(config: Config, directory: Path) -> Config:
    """Copy robot, motions and bodies into the directory of a dataset; return the configuration of the copies."""
    if (source := find_files(config)) is not None:
        copy_robot(source, directory)
    family, target = config.task.trajectory, directory / MOTIONS
    if isinstance(family, MotionFile) and family.file not in (MOTIONS, str(target.absolute())):
        write_file(target, _encode_motions(family, config))
    placed = _place_robot(config, directory / ROBOT).with_files_in(directory)
    for name, body in config.scene.bodies.items():
        # A relative file is that of a dataset already.
        if isinstance(body, FileBodyConfig) and Path(body.file).is_absolute() and body != placed.scene.bodies[name]:
            (directory / BODIES).mkdir(exist_ok=True)
            for file, content in files_of(body).items():
                write_file(directory / BODIES / file, content)
    return placed


def _encode_motions(family: MotionFile, config: Config) -> bytes:
    return encode_table(motions_of(family, robot_of(config)).table())


def copy_robot(source: Path, directory: Path) -> None:
    """Copy the files of a robot into the directory of a dataset, unless they are there."""
    target = directory / ROBOT
    if source == Path(ROBOT) or source.resolve() == target.resolve():
        return
    scratch = Path(tempfile.mkdtemp(prefix=f".{ROBOT}-", dir=directory))
    try:
        for path in list_files(source):
            shutil.copyfile(path, scratch / path.name)
        shutil.rmtree(target, ignore_errors=True)
        scratch.chmod(0o755)
        scratch.rename(target)
    finally:
        shutil.rmtree(scratch, ignore_errors=True)


def find_files(config: Config) -> Path | None:
    """Find the directory with the files of a robot; None if it is installed."""
    return Path(config.robot.urdf).parent if isinstance(config.robot, DescribedRobotConfig) else None


def pack_robot(config: Config) -> str:
    """Write all files that a dataset carries as a string, a zip archive in base64; it is empty if there are none."""
    source = find_files(config)
    files = {f"{ROBOT}/{path.name}": path.read_bytes() for path in (list_files(source) if source else ())}
    if isinstance(family := config.task.trajectory, MotionFile):
        files[MOTIONS] = _encode_motions(family, config)
    for body in config.scene.bodies.values():
        if isinstance(body, FileBodyConfig):
            files |= {f"{BODIES}/{name}": content for name, content in files_of(body).items()}
    packed = io.BytesIO()
    if files:
        with zipfile.ZipFile(packed, "w", zipfile.ZIP_DEFLATED, compresslevel=1) as archive:
            for name, content in files.items():
                archive.writestr(name, content)
    return base64.b64encode(packed.getvalue()).decode()


def unpack_robot(text: str, directory: Path) -> None:
    """Write the files of `pack_robot` into the directory of a dataset."""
    if text:
        with zipfile.ZipFile(io.BytesIO(base64.b64decode(text))) as archive:
            archive.extractall(directory)


def copy_carried(source: Path, directory: Path) -> None:
    """Copy the files of robot and bodies from the directory of a dataset into another one."""
    for name in list_carried(source):
        (directory / name).parent.mkdir(exist_ok=True)
        shutil.copyfile(source / name, directory / name)


def list_carried(directory: Path) -> list[str]:
    """List the files of robot and bodies in a dataset, by their names there."""
    return [
        f"{place}/{path.name}"
        for place in (ROBOT, BODIES)
        if (directory / place).is_dir()
        for path in list_files(directory / place)
    ]
