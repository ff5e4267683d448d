import pytest

from rclzenoh.exceptions import NameValidationException
from rclzenoh.names import resolve


@pytest.mark.parametrize(
    ("name", "absolute"),
    [("/a/b", "/a/b"), ("a", "/ns/a"), ("~/a", "/ns/node/a"), ("a/_action/status", "/ns/a/_action/status")],
)
def test_names_are_resolved_in_the_namespace_of_the_node(name, absolute):
    assert resolve(name, "/ns", "node") == absolute


def test_names_in_the_root_namespace_have_one_slash():
    assert resolve("a", "/", "node") == "/a"
    assert resolve("~/a", "/", "node") == "/node/a"


@pytest.mark.parametrize("name", ["", "/", "a//b", "a/", "1a", "a-b", "a b", "~a", "/a/*", "a%b", "@x"])
def test_invalid_names_are_refused(name):
    with pytest.raises(NameValidationException, match="invalid topic or service name"):
        resolve(name, "/", "node")
