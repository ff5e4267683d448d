"""Rules of this project that no linter checks."""

import ast
import re
from collections.abc import Iterator
from pathlib import Path

import pytest
from tests.architecture.parsing import parse

ROOT = Path(__file__).parents[2]
SOURCE = ROOT / "src" / "throwcollect"
CLIENT = ROOT / "src" / "rclzenoh"
MODULES = sorted([*SOURCE.rglob("*.py"), *CLIENT.rglob("*.py")])
VAGUE = {"utils", "util", "helpers", "common", "misc", "base", "core", "types", "manager"}
LONGEST_MODULE = 400
LONGEST_FUNCTION = 60
LONGEST_TEST = 500
"""Most lines of a module of tests; longer modules had several subjects."""
CEILING = 56_747
"""Most lines of Python in `src`. Every commit that deletes lowers it; see CONTRIBUTING.md for what may be added."""


def name(path: Path) -> str:
    return str(path.relative_to(SOURCE if SOURCE in path.parents else CLIENT.parent))


def offences(path: Path, text: str) -> Iterator[str]:
    """What a module does that no module may do."""
    tree = parse(text)
    if not ast.get_docstring(tree):
        yield "has no docstring"
    if path.stem in VAGUE:
        yield "has a name that says nothing"
    if (lines := len(text.splitlines())) > LONGEST_MODULE:
        yield f"has {lines} lines"
    for node in ast.walk(tree):
        if isinstance(node, ast.FunctionDef | ast.AsyncFunctionDef):
            body = node.end_lineno - node.body[0].lineno + 1
            if body > LONGEST_FUNCTION:
                yield f"{node.name} has {body} lines"
    if re.search(r"^\s*(from|import) (tests|bench)\b", text, flags=re.MULTILINE):
        yield "imports tests"
    if re.search(r"\b(TODO|FIXME|XXX)\b", text):
        yield "has an unfinished place"


def test_the_source_does_not_grow() -> None:
    assert sum(len(path.read_text(encoding="utf-8").splitlines()) for path in MODULES) <= CEILING


def test_modules_keep_the_rules() -> None:
    found = {name(path): list(offences(path, path.read_text(encoding="utf-8"))) for path in MODULES}
    assert {path: each for path, each in found.items() if each} == {}


def test_modules_of_tests_are_not_too_long() -> None:
    lengths = {path: len(path.read_text(encoding="utf-8").splitlines()) for path in (ROOT / "tests").rglob("*.py")}
    assert lengths
    assert {str(path): lines for path, lines in lengths.items() if lines > LONGEST_TEST} == {}


UNITS = ROOT / "tests" / "unit"
OUTSIDE_SOURCE = {"wheels"}
"""Folders of unit tests of scripts, which lie in `docker` and `packaging`."""


def is_named_after_a_module(test: Path) -> bool:
    """Whether a test such as ``tests/unit/plan/test_plan.py`` has the place and the name of a module or a package."""
    place = SOURCE / test.relative_to(UNITS).parent / test.stem.removeprefix("test_")
    return place.with_suffix(".py").exists() or (place / "__init__.py").exists()


def test_a_unit_test_file_is_named_after_a_module_or_has_a_docstring() -> None:
    """A test of several modules together, for example, is named freely, and its docstring says what it tests."""
    tests = sorted(UNITS.rglob("test_*.py"))
    folders = {test.parent.relative_to(UNITS) for test in tests}
    assert {str(folder) for folder in folders if not (SOURCE / folder).is_dir()} == OUTSIDE_SOURCE
    others = [test for test in tests if not is_named_after_a_module(test)]
    assert [str(test) for test in others if not ast.get_docstring(parse(test.read_text(encoding="utf-8")))] == []


CLOCK_OF_ALL = re.compile(r"""setattr\((?:\w+\.)*time, ["']|setattr\(["']time\.""")
"""Tests must not set the clock of the whole process, which stops threads of other tests, but that of a module."""


def test_no_test_sets_the_clock_of_the_whole_process() -> None:
    sources = sorted((ROOT / "tests").rglob("*.py"))
    assert [name for name in sources if CLOCK_OF_ALL.search(name.read_text(encoding="utf-8"))] == []


def unfold(statement: ast.stmt) -> list[ast.stmt]:
    """Give the statements in both branches of `if TYPE_CHECKING`, or else the statement itself."""
    if isinstance(statement, ast.If) and ast.unparse(statement.test) == "TYPE_CHECKING":
        return [*statement.body, *statement.orelse]
    return [statement]


def test_package_faces_hold_only_re_exports() -> None:
    for path in (path for path in MODULES if path.name == "__init__.py"):
        statements = parse(path.read_text(encoding="utf-8")).body
        for node in [inner for each in statements for inner in unfold(each)]:
            plain = isinstance(node, ast.Expr | ast.ImportFrom | ast.Import)
            lazy = isinstance(node, ast.FunctionDef) and node.name in {"__getattr__", "__dir__"}
            table = isinstance(node, ast.Assign) and node.targets[0].id in {"__all__", "_PLACES"}
            assert plain or lazy or table, path


PURE_ROOMS = ("plan", "tasks", "episode", "robots", "control", "engines", "sim")
"""Rooms whose numbers end up in the bytes of a dataset."""
OF_THE_PROCESSOR = re.compile(
    r"np\.(exp|exp2|expm1|log|log2|log10|log1p|power|float_power|cbrt|sin|cos|tan|arcsin|arccos|arctan|arctan2|sinh|"
    r"cosh|tanh|hypot|geomspace|logspace|dot|vdot|inner|matmul|tensordot|einsum|linalg\.\w+)"
)
HARMLESS = {
    "engines/mesh.py": {"np.linalg.svd", "@"},  # whether a mesh is flat; whole numbers of cells
    "robots/oddities.py": {"np.linalg.norm"},  # what is odd about a robot
    "robots/joint_model.py": {"np.linalg.eigvalsh"},  # whether an inertia is possible
    "tasks/dmp.py": {"np.linalg.lstsq"},  # weights for a YAML file
}


def processor_dependent(tree: ast.AST) -> set[str]:
    """What NumPy, BLAS or LAPACK may compute otherwise on another processor; see `throwcollect.reproducible_math`."""
    found = set()
    for node in ast.walk(tree):
        match node:
            case ast.Attribute() if OF_THE_PROCESSOR.fullmatch(ast.unparse(node)):
                found.add(ast.unparse(node))
            case ast.BinOp(op=ast.MatMult()):
                found.add("@")
            case ast.BinOp(left=ast.Constant(), op=ast.Pow()) | ast.BinOp(op=ast.Pow(), right=ast.Constant(value=2)):
                pass
            case ast.BinOp(op=ast.Pow()):
                found.add("**")
    return found


@pytest.mark.parametrize("room", PURE_ROOMS)
def test_pure_rooms_avoid_arithmetic_that_depends_on_the_processor(room: str) -> None:
    paths = sorted((SOURCE / room).rglob("*.py"))
    assert paths
    found = {name(path): processor_dependent(parse(path.read_text(encoding="utf-8"))) for path in paths}
    assert {path: names for path, names in found.items() if names} == {
        path: names for path, names in HARMLESS.items() if path.startswith(f"{room}/")
    }
