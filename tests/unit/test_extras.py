import sys
from importlib.util import find_spec
from pathlib import Path

import pytest

from throwcollect.errors import ConfigError, ThrowcollectError
from throwcollect.extras import (
    EXTRA_OF,
    MissingExtraError,
    explain_missing,
    is_installed,
    lazily,
    require,
)


@pytest.fixture
def without_scipy(monkeypatch: pytest.MonkeyPatch) -> None:
    for name in [name for name in sys.modules if name.partition(".")[0] == "scipy"]:
        monkeypatch.delitem(sys.modules, name)
    monkeypatch.setitem(sys.modules, "scipy", None)


def test_a_lazy_module_is_imported_at_its_first_use(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.delitem(sys.modules, "colorsys", raising=False)
    module = lazily("colorsys")
    assert "colorsys" not in sys.modules
    assert module.rgb_to_hsv(1, 1, 1) == (0, 0, 1)
    assert module.rgb_to_hsv is sys.modules["colorsys"].rgb_to_hsv


def test_an_unknown_attribute_of_a_lazy_module_is_an_attribute_error() -> None:
    with pytest.raises(AttributeError, match="rgb_to_taste"):
        _ = lazily("colorsys").rgb_to_taste


def test_a_missing_package_is_an_error_that_names_its_extra(without_scipy) -> None:
    with pytest.raises(MissingExtraError) as raised:
        _ = lazily("scipy.io").savemat
    assert str(raised.value) == "this needs scipy, which is not installed\n  try: pip install 'throwcollect[export]'"
    assert (raised.value.package, raised.value.extra, raised.value.exit_code) == ("scipy", "export", 2)


def test_a_missing_package_of_several_extras_names_the_requested_one(without_scipy) -> None:
    with pytest.raises(MissingExtraError, match=r"throwcollect\[export\]"):
        _ = lazily("scipy.io", extra="export").savemat
    with pytest.raises(MissingExtraError, match=r"throwcollect\[export\]"):
        require("numpy", "scipy", extra="export")


def test_a_missing_extra_is_an_import_error(without_scipy) -> None:
    with pytest.raises(ImportError), explain_missing():
        import scipy  # noqa: F401
    assert issubclass(MissingExtraError, ThrowcollectError)


def test_a_missing_module_of_no_extra_stays_an_import_error() -> None:
    with pytest.raises(ModuleNotFoundError, match="throwcollect_of_tomorrow") as raised, explain_missing():
        import throwcollect_of_tomorrow  # noqa: F401
    assert not isinstance(raised.value, MissingExtraError)


@pytest.mark.parametrize(
    ("reason", "kind"), [("libneedy.so.1: cannot open shared object file", ConfigError), ("of its own", ImportError)]
)
def test_a_library_that_the_system_lacks_is_named(
    reason: str, kind: type[Exception], tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    (tmp_path / "needy.py").write_text(f"raise ImportError({reason!r})")
    monkeypatch.syspath_prepend(tmp_path)
    with pytest.raises(kind, match=reason):
        _ = lazily("needy").anything


def test_a_missing_package_does_not_count_as_installed(without_scipy) -> None:
    assert is_installed("numpy")
    assert not is_installed("scipy")


@pytest.mark.parametrize(("version", "wheel"), [((3, 11, 9), True), ((3, 12, 0), False)])
def test_without_a_wheel_of_pybullet_the_hint_is_another_python(
    version: tuple[int, int, int], wheel: bool, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(sys, "version_info", version)
    error = MissingExtraError("pybullet")
    assert ("has no wheel for Python 3.12" in str(error)) == (not wheel)
    assert ("pip install" in str(error.hint)) == wheel


@pytest.mark.parametrize(("version", "wheel"), [((3, 10, 13), False), ((3, 11, 9), True), ((3, 14, 0), True)])
def test_without_a_wheel_of_mujoco_the_hint_is_another_python_or_engine(
    version: tuple[int, int, int], wheel: bool, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(sys, "version_info", version)
    error = MissingExtraError("mujoco")
    assert ("has no wheel for Python 3.10" in str(error)) == (not wheel)
    assert error.hint == (
        "pip install 'throwcollect[mujoco]'" if wheel else "Python 3.11 or later, or `sim.engine: bullet`"
    )


def test_every_package_of_the_extras_is_installed_for_the_tests() -> None:
    assert [package for package in EXTRA_OF if find_spec(package) is None] == []
