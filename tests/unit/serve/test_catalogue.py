"""Catalogues, and messages about mistakes in them."""

from pathlib import Path

import pytest
from tests.unit.serve.conftest import CONFIG

from throwcollect.config.run import ContainerSpec, NodeContainerConfig
from throwcollect.errors import ConfigError, NotFoundError
from throwcollect.serve.catalogue import Catalogue


@pytest.fixture
def directory(tmp_path: Path) -> Path:
    (tmp_path / "small.yaml").write_text(CONFIG)
    return tmp_path


def write(directory: Path, text: str) -> Path:
    path = directory / "catalogue.yaml"
    path.write_text(text)
    return path


def test_a_catalogue_is_read_with_its_components(directory: Path) -> None:
    first = "{config: small.yaml, pretty_name: Throws of A, max_instances: 3}"
    catalogue = Catalogue.read(write(directory, f"components:\n  a: {first}\n  b: {{session: small.yaml}}\n"))
    a, b = catalogue.get("a"), catalogue.get("b")
    assert (a.kind, a.pretty_name, a.max_instances, a.source) == (
        "collection",
        "Throws of A",
        3,
        directory / "small.yaml",
    )
    assert (b.kind, b.pretty_name, b.max_instances) == ("session", "b", 1)
    with pytest.raises(NotFoundError, match=r"^no component 'c'; known: a and b$"):
        catalogue.get("c")


def test_a_container_component_is_read_with_all_its_keys(directory: Path) -> None:
    (directory / "a.urdf").write_text("<robot/>")
    text = (
        "components:\n  a:\n    image: x\n    command: [run, it]\n    environment: {LAB: north}\n    networks: [lab]\n"
    )
    text += f"    volumes: ['{directory}:/mesh:ro']\n    cpus: 2\n    urdf: a.urdf\n"
    a = Catalogue.read(write(directory, text)).get("a")
    node = NodeContainerConfig(environment={"LAB": "north"}, networks=["lab"], mounts=[f"{directory}:/mesh:ro"], cpus=2)
    assert (a.kind, a.source, a.urdf) == ("container", ContainerSpec("x", ("run", "it"), node), directory / "a.urdf")


def test_a_configuration_alone_gives_a_catalogue_of_one_component(directory: Path) -> None:
    catalogue = Catalogue.read(directory / "small.yaml")
    assert [(each.name, each.kind, each.max_instances) for each in catalogue.components.values()] == [
        ("small", "collection", 1)
    ]


@pytest.mark.parametrize(
    ("text", "message"),
    [
        (
            "components:\n  a:\n    config: small.yaml\n    cpus: 2\n",
            ":4: components.a.cpus: should be left out; it is",
        ),
        ("components:\n  a:\n    image: x\n    privileged: true\n", ":4: components.a.privileged: unknown key"),
    ],
)
def test_mistakes_in_a_catalogue_are_reported_with_line_and_key(directory: Path, text: str, message: str) -> None:
    path = write(directory, text)
    with pytest.raises(ConfigError) as error:
        Catalogue.read(path)
    assert str(path) in str(error.value)
    assert message.replace("DIRECTORY", str(directory)) in str(error.value)
