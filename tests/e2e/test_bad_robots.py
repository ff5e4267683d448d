"""Each mistake in the description of a robot gives one message with the key and the value, and no files."""

from __future__ import annotations

from collections.abc import Callable
from pathlib import Path

import pytest

from tests.e2e.collection import call_here
from tests.foreign_arm import BOX, FLANGE, mesh, write_arm

pytestmark = pytest.mark.e2e

BOMB = "".join(f'<!ENTITY a{n} "{(f"&a{n - 1};" if n else "aaaaaaaaaa") * 10}">' for n in range(10))
MASS = '<mass value="2"/>'
TAIL = """<link name="tail_link"/><joint name="wag" type="revolute"><parent link="base_link"/><child link="tail_link"/>
<limit lower="-1" upper="1" velocity="1" effort="1"/></joint></robot>"""


def change(*changes: tuple[str, str]) -> Callable[[Path], object]:
    return lambda directory: write_arm(directory, *changes)


def put(content: str | bytes, name: str = "arm.urdf") -> Callable[[Path], object]:
    return lambda directory: (directory / name).write_bytes(content.encode() if isinstance(content, str) else content)


def collide(filename: str, content: bytes | None = None) -> Callable[[Path], object]:
    """Write the arm with a mesh, whose file has this content."""

    def write(directory: Path) -> None:
        write_arm(directory, (BOX, mesh(filename)))
        if content is not None:
            (directory / filename).write_bytes(content)

    return write


FILES = {
    "missing": (lambda directory: (directory / "arm.urdf").unlink(), ".urdf: {}/arm.urdf: no such file"),
    "bomb": (
        put(f'<!DOCTYPE robot [{BOMB}]><robot name="&a9;"/>'),
        ": {}/arm.urdf: cannot be read as robot description: not well-formed XML: limit on input amplification",
    ),
    "no mass": (
        change((MASS, '<mass value="0"/>')),
        ": {}/arm.urdf: link upper_link, which lift moves, has no mass\n  try: give it an <inertial>",
    ),
    "mesh missing": (collide("a.stl"), ": {}/arm.urdf: link upper_link: a.stl: there is no file {}/a.stl"),
}
"""What is wrong with the file of a robot, and how the message goes on after the key `robot`."""

KEYS = {
    "flange": ({"flange": "lange_link"}, ".flange: {}/arm.urdf has no link 'lange_link'; did you mean 'flange_link'?"),
    "joint of two controllers": (
        {"controllers": "{arm: [turn, lift], wrist: [lift, bend]}"},
        ".controllers: the joint lift is there twice",
    ),
    "no such URDF": (
        {"urdf": "amr.urdf"},
        ".urdf: {}/amr.urdf: no such file; did you mean '{}/arm.urdf'?\n  try: docs/robots",
    ),
}
"""What is wrong with the section of a robot, and how the message goes on after the key `robot`."""


@pytest.fixture
def directory(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Path:
    monkeypatch.chdir(tmp_path)
    write_arm(tmp_path)
    return tmp_path


def check(arguments: list[str], message: str, directory: Path) -> None:
    before = sorted(directory.iterdir())
    done = call_here(*arguments)
    assert (done.returncode, done.stdout) == (2, "")
    assert done.stderr.startswith(f"throwcollect: {message}"), done.stderr
    assert len(done.stderr.splitlines()) <= 3
    assert len(done.stderr) < 1500
    assert sorted(directory.iterdir()) == before


@pytest.mark.parametrize(("prepare", "said"), FILES.values(), ids=FILES)
def test_a_wrong_file_of_a_robot_is_named_by_import_and_plan(
    prepare: Callable[[Path], object], said: str, directory: Path
) -> None:
    prepare(directory)
    (directory / "a.yaml").write_text(f"trials: 2\nrobot: {{urdf: arm.urdf, flange: {FLANGE}}}\n")
    said = said.replace("{}", str(directory))
    if not said.startswith((":", ".")):
        said = f": {directory}/arm.urdf: cannot be read as robot description: {said}"
    check(["robot", "import", "arm.urdf", "--flange", FLANGE, "-o", "out"], f"robot{said}", directory)
    check(["plan", "a.yaml"], f"a.yaml:2: robot{said}", directory)


@pytest.mark.parametrize(("given", "said"), KEYS.values(), ids=KEYS)
def test_a_wrong_key_of_a_robot_is_named_with_its_line(given: dict[str, str], said: str, directory: Path) -> None:
    write_arm(directory, ("</robot>", TAIL))
    keys = {"urdf": "arm.urdf", "flange": FLANGE, **given}
    section = ", ".join(f"{key}: {value}" for key, value in keys.items())
    (directory / "a.yaml").write_text(f"trials: 2\nrobot: {{{section}}}\n")
    check(["plan", "a.yaml"], f"a.yaml:2: robot{said.replace('{}', str(directory))}", directory)
