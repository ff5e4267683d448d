from pathlib import Path

from throwcollect.collect.runtimes.image_sources import digest_sources


def test_every_file_that_decides_what_is_installed_changes_the_digest_of_the_sources(tmp_path: Path) -> None:
    (tmp_path / "src" / "__pycache__").mkdir(parents=True)
    changes = {"pyproject.toml": "a", "uv.lock": "a", "src/a.py": "a", "src/b.py": "a", "src/__pycache__/a.pyc": "a"}
    for name, content in changes.items():
        (tmp_path / name).write_text(content)
    digests = [digest_sources(tmp_path)]
    for name in changes:
        (tmp_path / name).write_text("b")
        digests.append(digest_sources(tmp_path))
    assert len(set(digests)) == 5
    assert digests[-1] == digests[-2]
