"""Each mistake in the description of a robot gives one message with the key and the value, and no files."""

from __future__ import annotations

from collections.abc import Callable
from pathlib import Path

import pytest

from tests.e2e.collection import call_here
from tests.foreign_arm import BOX, CORNERS, FLANGE, MOUNT, mesh, stl, write_arm

pytestmark = pytest.mark.e2e

BOMB = "".join(f'<!ENTITY a{n} "{(f"&a{n - 1};" if n else "aaaaaaaaaa") * 10}">' for n in range(10))
MASS = '<mass value="2"/>'
LIMIT = '<limit lower="-2.5" upper="2.6" velocity="6" effort="150"/>'
ASIDE = 'rpy="1.5707963267948966 0 1.5707963267948966"'
"""A flange whose x axis, in which the tool opens, stays horizontal."""
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
    "xacro": (
        change(("Foreign Arm", "${name}")),
        ": {}/arm.urdf: is xacro, not URDF; convert it with `xacro FILE > robot.urdf`",
    ),
    "ring": (change(('"base_link"/><child', '"fore_link"/><child')), ": {}/arm.urdf: the joints form a ring"),
    "no mass": (
        change((MASS, '<mass value="0"/>')),
        ": {}/arm.urdf: link upper_link, which lift moves, has no mass\n  try: give it an <inertial>",
    ),
    "inertia of no body": (
        change(('<mass value="3"/>\n      <inertia ixx="0.002"', '<mass value="3"/>\n      <inertia ixx="9"')),
        ": {}/arm.urdf: link turret_link, which turn moves, has principal moments of inertia of",
    ),
    "no speed": (
        change(('velocity="6"', 'velocity="0"')),
        ".limits.turn: the URDF has no max_velocity above 0: give one",
    ),
    "mesh missing": (collide("a.stl"), ": {}/arm.urdf: link upper_link: a.stl: there is no file {}/a.stl"),
    "mesh in millimetres": (
        collide("a.stl", stl(CORNERS * 1000)),
        ': {}/a.stl: 300 m large\n  try: a mesh in millimetres has <mesh scale="0.001 0.001 0.001"> in the URDF',
    ),
    "name of a robot": (
        change(("Foreign Arm", "Talos")),
        ".name: talos is the name of an installed robot; give another one",
    ),
    "cannot hold the tool": (
        change(('"turn" type="revolute"', '"turn" type="fixed"'), (MOUNT, ASIDE)),
        ": no posture holds the tool upright and is clear: the best angle is 90°\n  try: turn the hand by robot.tool",
    ),
}
"""What is wrong with the file of a robot, and how the message goes on after the key `robot`."""

KEYS = {
    "flange": ({"flange": "lange_link"}, ".flange: {}/arm.urdf has no link 'lange_link'; did you mean 'flange_link'?"),
    "unknown joint": (
        {"controllers": "{arm: [turn, lfit]}"},
        ".controllers.arm: {}/arm.urdf has no joint 'lfit'; did you mean 'lift'?",
    ),
    "joint of two controllers": (
        {"controllers": "{arm: [turn, lift], wrist: [lift, bend]}"},
        ".controllers: the joint lift is there twice",
    ),
    "no controllers": (
        {"controllers": "{}"},
        ".controllers: each should have joints, and some should move flange_link",
    ),
    "limits in the wrong order": (
        {"limits": "{lift: {min_position: 3}}"},
        ".limits.lift: min_position should be below max_position, got 3 and 2.6",
    ),
    "unknown posture": ({"home": "rest"}, ".home: no group_state 'rest'; robot.srdf has none"),
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


@pytest.mark.parametrize(
    ("arguments", "message"),
    [
        (
            ["init", "--robot", "arm.urdf"],
            "arm.urdf: a URDF needs the link that holds the tool\n  try: name it: --flange LINK",
        ),
        (
            ["init", "--robot", "kuka"],
            "kuka: no such robot is installed; known: talos, talos_left, panda, ur5, xarm7 and 2 more\n  try: docs",
        ),
        (["robot", "check", "pandaa"], "pandaa: no such robot is installed; did you mean 'panda'?\n  try: docs/robots"),
        (["robot", "import", "talos"], "talos: is no robot that a URDF alone describes"),
        (
            ["plan", "kuka.yaml"],
            "kuka.yaml:2: robot.name: no robot 'kuka' is installed; known: talos, talos_left, panda, ur5, xarm7 and 2 "
            "more; docs/robots.md says how to add one",
        ),
        (
            ["plan", "foreign.yaml"],
            "foreign.yaml: task.start: missing, and the default has joints that foreign_arm lacks; "
            "`throwcollect init --robot URDF --flange flange_link` writes one",
        ),
    ],
)
def test_a_robot_that_is_named_wrongly_leads_to_what_helps(arguments: list[str], message: str, directory: Path) -> None:
    (directory / "kuka.yaml").write_text("trials: 2\nrobot: {name: kuka}\n")
    (directory / "foreign.yaml").write_text(f"trials: 2\nrobot: {{urdf: arm.urdf, flange: {FLANGE}}}\n")
    check(arguments, message.replace("{}", str(directory)), directory)
