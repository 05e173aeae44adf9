"""What exports wrote when they were last looked at. ``python -m tests.estimators.exports.golden`` writes it anew."""

import re
from pathlib import Path

from tests.estimators.exports.models import lucas_kanade

from tracknoise.estimators.export_render import export
from tracknoise.estimators.exports import Export, estimators

FOLDER = Path(__file__).with_name("golden")
NAMES = [name for name, about in estimators().items() if about.family != "data"]


def contents(name: str, found: Export) -> dict[str, str]:
    """Files of an export by name, its text and patch among them, without the hash of the model."""
    patch = {} if found.patch is None else {f"{name}.patch": found.patch}
    files = {**found.files, **patch, f"{name}.txt": found.text}
    return {file: re.sub(r"sha256 [0-9a-f]{12}", "sha256 (hash)", text) for file, text in files.items()}


def stored(name: str) -> dict[str, str]:
    return {path.stem: path.read_text() for path in (FOLDER / name).iterdir()}


if __name__ == "__main__":
    for name in NAMES:
        (FOLDER / name).mkdir(parents=True, exist_ok=True)
        for file, text in contents(name, export(lucas_kanade(), name, source="lk.noise.json")).items():
            (FOLDER / name / f"{file}.golden").write_text(text)
