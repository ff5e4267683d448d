"""The scripts of the image remove unneeded files from packages and keep the others."""

from __future__ import annotations

import base64
import hashlib
import re
import struct
import subprocess
import sys
import zipfile
from importlib.metadata import distribution
from importlib.util import find_spec
from pathlib import Path
from types import ModuleType

import pytest

from throwcollect.config.robot_config import DescribedRobotConfig
from throwcollect.robots.example_robots import PANDA, SO101, TIAGO, UR5, XARM7

ROOT = Path(__file__).parents[3]
EXTENSION = "pkg/lib.cpython-311-x86_64-linux-gnu.so"


@pytest.fixture(scope="session", autouse=True)
def _scripts() -> None:
    sys.path.append(str(ROOT / "docker"))


@pytest.fixture(scope="session")
def library() -> bytes:
    """A shared library with symbols and sections that needs others."""
    spec = find_spec("pybullet")
    assert spec is not None
    assert spec.origin is not None
    return Path(spec.origin).read_bytes()


@pytest.fixture
def wheelhouse(monkeypatch: pytest.MonkeyPatch) -> ModuleType:
    import wheelhouse

    monkeypatch.setattr(wheelhouse, "requirements", lambda: ["numpy"])
    return wheelhouse


def elf(*needed: str) -> bytes:
    """The least that the loader would read: a segment with a table of needed libraries, and rubbish behind it."""
    names = b"\0" + b"".join(name.encode() + b"\0" for name in needed)
    offsets = [names.index(name.encode()) for name in needed]
    size = 64 + 2 * 56
    dynamic = b"".join(struct.pack("<QQ", 1, offset) for offset in offsets)
    dynamic += struct.pack("<QQ", 5, size) + struct.pack("<QQ", 0, 0)
    end = size + len(names) + len(dynamic)
    header = struct.pack("<16sHHIQQQIHHHHHH", b"\x7fELF\x02\x01", 3, 62, 1, 0, 64, end, 0, 64, 56, 2, 64, 3, 2)
    load = struct.pack("<IIQQQQQQ", 1, 4, 0, 0, 0, end, end, 4096)
    table = struct.pack("<IIQQQQQQ", 2, 4, size + len(names), size + len(names), 0, len(dynamic), len(dynamic), 8)
    return header + load + table + names + dynamic + b"symbols" * 50


def test_a_stripped_library_is_shorter_and_still_loads(library: bytes, tmp_path: Path) -> None:
    from elf import list_needed, strip

    shorter = strip(library)
    assert len(shorter) < len(library) / 10
    assert list_needed(shorter) == list_needed(library)
    path = tmp_path / "stripped.so"
    path.write_bytes(shorter)
    # The library calls functions of Python, so another Python process loads it.
    code = "import ctypes, sys; print(ctypes.PyDLL(sys.argv[1]).PyInit_pybullet is not None)"
    ended = subprocess.run([sys.executable, "-c", code, str(path)], capture_output=True, text=True, check=True)
    assert ended.stdout == "True\n"
    assert strip(shorter) == shorter


@pytest.mark.parametrize(
    ("path", "stays"),
    [
        ("numpy/_core/tests/test_dtype.py", False),
        ("numpy/testing/__init__.py", True),
        ("pybullet_data/plane.urdf", False),
        ("mujoco/libmujoco.so.4.0.0", True),
        ("mujoco/_render.cpython-311-x86_64-linux-gnu.so", False),
        ("pyarrow/include/arrow/api.h", False),
        ("pyarrow/_fs.cpython-311-x86_64-linux-gnu.so", True),
        ("lz4-4.4.5.dist-info/METADATA", True),
        ("cmeel.prefix/share/example-robot-data/robots/talos_data/robots/talos_reduced.urdf", True),
        ("cmeel.prefix/lib/libcoal.so", True),
        ("cmeel.prefix/lib/cmake/coal/coalConfig.cmake", False),
        ("cmeel.prefix/bin/assimp", False),
        ("rclzenoh/interfaces/definitions/std_srvs/srv/Trigger.srv", True),
        ("ros_std_msgs-5.3.6.data/data/lib/libstd_msgs__rosidl_generator_c.so", True),
        ("ros_std_msgs-5.3.6.data/data/lib/python3.11/site-packages/std_msgs/msg/_string_s.c", False),
        (
            "ros_rmw_fastrtps_cpp-8.4.3.data/data/share/ament_index/resource_index/rmw_typesupport/rmw_fastrtps_cpp",
            True,
        ),
        ("ros_fastrtps-2.14.5.data/data/bin/fast-discovery-server", True),
        ("ros_fastrtps-2.14.5.data/data/bin/fast-discovery-server-1.0.1", False),
        ("environment.data/data/bin/python3", True),
    ],
)
def test_a_file_stays_if_a_node_may_load_it(path: str, stays: bool) -> None:
    from slim import is_kept

    assert is_kept(path) is stays


@pytest.mark.parametrize("robot", [PANDA, UR5, XARM7, TIAGO, SO101], ids=lambda robot: robot.name)
def test_all_files_of_a_built_in_robot_stay(robot: DescribedRobotConfig) -> None:
    from slim import is_kept

    urdf = f"example-robot-data/robots/{robot.urdf.removeprefix('example-robot-data:')}"
    text = Path(str(distribution("example-robot-data").locate_file(f"cmeel.prefix/share/{urdf}"))).read_text()
    meshes = re.findall(r'"package://([^"]+)"', text)
    assert meshes
    assert [path for path in (urdf, *meshes) if not is_kept(f"cmeel.prefix/share/{path}")] == []


def test_libraries_that_no_module_reaches_are_superfluous() -> None:
    from slim import find_unreached

    files = {
        EXTENSION: elf("liba.so.1", "libc.so.6"),
        "cmeel.prefix/lib/liba.so.1": elf("libb.so.2"),
        "cmeel.prefix/lib/liba.so.1.2.3": elf("libb.so.2"),
        "other.libs/libb.so.2": elf(),
        "other.libs/libd.so": elf("libe.so"),
        "other.libs/libe.so": elf("libd.so"),
        "pkg/libscript.so": b"INPUT(-lc)",
    }
    superfluous = find_unreached({name: (lambda content=content: content) for name, content in files.items()})
    assert superfluous == {"cmeel.prefix/lib/liba.so.1.2.3", "other.libs/libd.so", "other.libs/libe.so"}


def test_slimming_a_directory_again_changes_nothing(tmp_path: Path) -> None:
    from slim import slim

    for name, content in {
        EXTENSION: elf("liba.so"),
        "pkg/__init__.py": b"",
        "pkg/tests/deep/test_it.py": b"",
        "pkg.libs/liba.so": elf(),
        "pkg.libs/libz.so": elf(),
        "pkg-1.dist-info/METADATA": b"",
        "pkg-1.dist-info/RECORD": b"",
    }.items():
        path = tmp_path / name
        path.parent.mkdir(parents=True, exist_ok=True)
        path.write_bytes(content)

    def contents() -> dict[str, bytes]:
        return {str(path.relative_to(tmp_path)): path.read_bytes() for path in tmp_path.rglob("*") if path.is_file()}

    slim(tmp_path)
    first = contents()
    assert set(first) == {EXTENSION, "pkg/__init__.py", "pkg.libs/liba.so", "pkg-1.dist-info/METADATA"}
    assert not first[EXTENSION].endswith(b"symbols")
    assert not (tmp_path / "pkg" / "tests").exists()
    slim(tmp_path)
    assert contents() == first


def fill(downloads: Path) -> None:
    """Two wheels: the first has a module that loads a library of the second, and the list of a vendored package."""
    with zipfile.ZipFile(downloads / "one-1-py3-none-any.whl", "w") as wheel:
        wheel.writestr("one/_vendor/zero-1.dist-info/RECORD", "")
        wheel.writestr("one/tests/test_it.py", "")
        wheel.writestr("one/module.cpython-311-x86_64-linux-gnu.so", elf("libtwo.so.1"))
        wheel.writestr("one-1.dist-info/RECORD", "")
    with zipfile.ZipFile(downloads / "two-1-py3-none-any.whl", "w") as wheel:
        wheel.writestr("two.libs/libtwo.so.1", elf())
        wheel.writestr("two.libs/libtwo.so", elf())
        wheel.writestr("two-1.dist-info/RECORD", "")


def test_repacked_wheels_have_correct_lists_of_their_files(wheelhouse: ModuleType, tmp_path: Path) -> None:
    before, after = tmp_path / "before", tmp_path / "after"
    before.mkdir()
    after.mkdir()
    fill(before)
    wheelhouse.repack(sorted(before.glob("*.whl")), after)
    names = {}
    for path in sorted(after.glob("*.whl")):
        with zipfile.ZipFile(path) as wheel:
            names[path.name] = set(wheel.namelist())
            record = next(name for name in wheel.namelist() if name.endswith("RECORD"))
            listed = [line.split(",") for line in wheel.read(record).decode().splitlines()]
            assert {name for name, _, _ in listed} == names[path.name]
            for name, hashed, size in listed[:-1]:
                content = wheel.read(name)
                digest = base64.urlsafe_b64encode(hashlib.sha256(content).digest()).rstrip(b"=").decode()
                assert (hashed, int(size)) == (f"sha256={digest}", len(content))
    assert names == {
        "one-1-py3-none-any.whl": {"one/module.cpython-311-x86_64-linux-gnu.so", "one-1.dist-info/RECORD"},
        "two-1-py3-none-any.whl": {"two.libs/libtwo.so.1", "two-1.dist-info/RECORD"},
    }


def test_wheels_are_downloaded_again_only_when_the_dependencies_change(
    wheelhouse: ModuleType, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    downloads: list[Path] = []

    def download(directory: Path) -> None:
        downloads.append(directory)
        fill(directory)

    monkeypatch.setattr(wheelhouse, "download", download)
    target = tmp_path / "wheels"
    wheelhouse.main(target)
    wheelhouse.main(target)
    assert len(downloads) == 1
    monkeypatch.setattr(wheelhouse, "requirements", lambda: ["numpy", "scipy"])
    wheelhouse.main(target)
    assert len(downloads) == 2
