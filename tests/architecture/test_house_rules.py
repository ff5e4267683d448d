"""Rules of the house that no linter knows."""

import ast
import re
from pathlib import Path

import pytest

ROOT = Path(__file__).parents[2]
SOURCE = ROOT / "src" / "throwcollect"
MODULES = sorted(SOURCE.rglob("*.py"))
VAGUE = {"utils", "util", "helpers", "common", "misc", "base", "core", "types", "manager"}
LONGEST_MODULE = 400
LONGEST_FUNCTION = 60


def name(path: Path) -> str:
    return str(path.relative_to(SOURCE))


@pytest.mark.parametrize("path", MODULES, ids=name)
def test_a_module_is_one_noun(path: Path) -> None:
    text = path.read_text(encoding="utf-8")
    tree = ast.parse(text)
    assert ast.get_docstring(tree) or path.name == "py.typed"
    assert path.stem not in VAGUE
    assert len(text.splitlines()) <= LONGEST_MODULE
    for node in ast.walk(tree):
        if isinstance(node, ast.FunctionDef | ast.AsyncFunctionDef):
            body = node.end_lineno - node.body[0].lineno + 1
            assert body <= LONGEST_FUNCTION, node.name


@pytest.mark.parametrize("path", MODULES, ids=name)
def test_package_code_never_imports_tests_and_has_no_unfinished_places(path: Path) -> None:
    text = path.read_text(encoding="utf-8")
    assert not re.search(r"^\s*(from|import) (tests|bench)\b", text, flags=re.MULTILINE)
    assert not re.search(r"\b(TODO|FIXME|XXX)\b", text)


def unfolded(statement: ast.stmt) -> list[ast.stmt]:
    """What stands in both branches of `if TYPE_CHECKING`, or else the statement itself."""
    if isinstance(statement, ast.If) and ast.unparse(statement.test) == "TYPE_CHECKING":
        return [*statement.body, *statement.orelse]
    return [statement]


def test_package_faces_hold_re_exports_only() -> None:
    for path in SOURCE.rglob("__init__.py"):
        statements = ast.parse(path.read_text(encoding="utf-8")).body
        for node in [inner for each in statements for inner in unfolded(each)]:
            plain = isinstance(node, ast.Expr | ast.ImportFrom | ast.Import)
            lazy = isinstance(node, ast.FunctionDef) and node.name in {"__getattr__", "__dir__"}
            assert plain or lazy or (isinstance(node, ast.Assign) and node.targets[0].id == "__all__"), path


def test_every_room_of_the_tree_stands_in_the_architecture() -> None:
    text = (ROOT / "docs" / "architecture.md").read_text(encoding="utf-8")
    for room in SOURCE.iterdir():
        if room.is_dir() and (room / "__init__.py").exists():
            assert f"`{room.name}`" in text, room.name


PURE_ROOMS = ("sweep", "tasks", "episode", "robots", "control", "sim")
"""Rooms whose numbers end up in the bytes of a dataset."""
OF_THE_PROCESSOR = re.compile(
    r"np\.(exp|exp2|expm1|log|log2|log10|log1p|power|float_power|cbrt|sin|cos|tan|arcsin|arccos|arctan|arctan2|sinh|"
    r"cosh|tanh|hypot|geomspace|logspace|dot|vdot|inner|matmul|tensordot|einsum|linalg\.\w+)"
)
HARMLESS = {
    "sim/urdf.py": {"np.linalg.norm", "np.linalg.eigh", "@"},  # whether a model can be spawned
    "tasks/dmp.py": {"np.linalg.lstsq"},  # weights for a YAML file
    "tasks/flight.py": {"np.linalg.norm"},  # a distance that is compared with a tolerance
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


def test_the_rule_about_processors_sees_what_it_should() -> None:
    code = "np.exp(x) + np.linalg.solve(a, b) + a @ b + x**3 + x**y + x**2 + 10**9 + np.sqrt(x) + math.exp(1)"
    assert processor_dependent(ast.parse(code)) == {"np.exp", "np.linalg.solve", "@", "**"}


@pytest.mark.parametrize("room", PURE_ROOMS)
def test_what_ends_up_in_a_dataset_does_not_depend_on_the_processor(room: str) -> None:
    paths = sorted((SOURCE / room).rglob("*.py"))
    assert paths
    found = {name(path): processor_dependent(ast.parse(path.read_text(encoding="utf-8"))) for path in paths}
    assert {path: names for path, names in found.items() if names} == {
        path: names for path, names in HARMLESS.items() if path.startswith(f"{room}/")
    }
