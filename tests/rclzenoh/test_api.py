import re
from pathlib import Path

from rclzenoh import api as embedded


def test_every_public_name_of_the_embedded_backend_is_used() -> None:
    root = Path(__file__).parents[2]
    # These modules name what a backend has; all others name only what they use.
    backends = [root / "src" / "throwcollect" / "ros" / f"{name}.py" for name in ("__init__", "embedded", "genuine")]
    used = "\n".join(
        path.read_text(encoding="utf-8")
        for folder in (root / "src" / "throwcollect", root / "tests", root / "bench")
        for path in folder.rglob("*.py")
        if path not in backends
    )
    assert [name for name in embedded.__all__ if not re.search(rf"\b{name}\b", used)] == []
