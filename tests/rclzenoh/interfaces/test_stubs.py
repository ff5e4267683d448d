"""Generated files in the repository match the output of their scripts."""

import importlib.util
from pathlib import Path

import pytest

from rclzenoh.interfaces import action, get_action, get_message, get_service, msg, srv, typed_names

PACKAGING = Path(__file__).parents[3] / "packaging"
GENERATOR = PACKAGING / "interface_stubs.py"


def load_script(path):
    spec = importlib.util.spec_from_file_location(path.stem, path)
    module = importlib.util.module_from_spec(spec)
    spec.loader.exec_module(module)
    return module


@pytest.fixture(scope="module")
def generator():
    return load_script(GENERATOR)


def test_the_file_of_interfaces_matches_its_script():
    script = load_script(PACKAGING / "interfaces.py")
    assert script.PATH.read_text("utf-8") == script.Interfaces().write(), "python packaging/interfaces.py writes it"


def test_the_committed_stubs_match_the_definitions(generator):
    for path, text in generator.stubs().items():
        assert path.read_text(encoding="utf-8") == text, f"python packaging/{GENERATOR.name} writes {path.name} again"


@pytest.mark.parametrize(
    ("module", "names", "get"),
    [
        (msg, typed_names.MESSAGES, get_message),
        (srv, typed_names.SERVICES, get_service),
        (action, typed_names.ACTIONS, get_action),
    ],
)
def test_typed_names_lead_to_the_interface_classes(module, names, get):
    assert {name: getattr(module, name) for name in names} == {name: get(full) for name, full in names.items()}
    with pytest.raises(AttributeError, match="has no attribute 'Nothing'"):
        _ = module.Nothing
