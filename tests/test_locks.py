"""Locked dependencies: what is installed by hash is what was tested together, and all that is declared."""

import re
import tomllib
from collections.abc import Iterator
from pathlib import Path

import pytest

ROOT = Path(__file__).parents[1]
PROJECT = tomllib.loads((ROOT / "pyproject.toml").read_text(encoding="utf-8"))
DECLARED = PROJECT["project"]["dependencies"]
EXTRAS = PROJECT["project"]["optional-dependencies"]
LOCKS = pytest.mark.parametrize(
    ("name", "needed"),
    [
        ("build", PROJECT["build-system"]["requires"]),
        ("package", DECLARED),
        ("dev", DECLARED + EXTRAS["dev"] + EXTRAS["cluster"] + EXTRAS["learned"]),
        ("docs", DECLARED + EXTRAS["docs"]),
    ],
)
HASH = re.compile(r"--hash=sha256:[0-9a-f]{64}")


def normal(name: str) -> str:
    return re.sub(r"[-_.]+", "-", re.split(r"[\s\[<>=!~;]", name)[0]).lower()


def pins(lines: list[str]) -> Iterator[tuple[str, str]]:
    """Name and version of each line; what stands behind is checked to be a marker and hashes."""
    for line in lines:
        requirement, *hashes = line.split(" --hash")
        name, version = requirement.partition(" ;")[0].split("==")
        yield normal(name), version.strip()
        assert all(HASH.fullmatch(f"--hash{one}".strip()) for one in hashes)


def locked(name: str) -> list[str]:
    text = (ROOT / "locks" / f"{name}.txt").read_text(encoding="utf-8")
    assert "://" not in text  # files come from whatever registry pip knows
    joined = text.replace("\\\n   ", "").splitlines()
    return [line for line in joined if line and not line.startswith("#")]


@LOCKS
def test_all_that_is_needed_is_locked_by_hash_at_the_tested_version(name, needed):
    lines = locked(name)
    assert all("--hash=sha256:" in line for line in lines)
    tested = dict(pins([line for line in (ROOT / "constraints.txt").read_text().splitlines() if line[0] != "#"]))
    found = dict(pins(lines))
    assert {one: version for one, version in found.items() if tested.get(one) != version} == {}
    assert {normal(one) for one in needed} - {*found, "tracknoise"} == set()
