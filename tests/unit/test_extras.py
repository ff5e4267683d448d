import sys
from importlib.util import find_spec

import pytest

from throwcollect.errors import ThrowcollectError
from throwcollect.extras import (
    EXTRA_OF,
    MissingExtraError,
    explain_missing,
    lazily,
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


def test_a_missing_package_is_an_error_that_names_its_extra(without_scipy) -> None:
    with pytest.raises(MissingExtraError) as raised:
        _ = lazily("scipy.io").savemat
    assert str(raised.value) == "this needs scipy, which is not installed\n  try: pip install 'throwcollect[export]'"
    assert (raised.value.package, raised.value.extra, raised.value.exit_code) == ("scipy", "export", 2)


def test_a_missing_extra_is_an_import_error(without_scipy) -> None:
    with pytest.raises(ImportError), explain_missing():
        import scipy  # noqa: F401
    assert issubclass(MissingExtraError, ThrowcollectError)


def test_every_package_of_the_extras_is_installed_for_the_tests() -> None:
    assert [package for package in EXTRA_OF if find_spec(package) is None] == []
