"""The tables of docs/tracker-presets.md, made again from the files of the presets.

python -m benchmarks.documents.presets
"""

from collections.abc import Iterator
from pathlib import Path

import tomlkit

from tracknoise.trackers.tracker_presets import load_preset, preset_names, preset_text

PAGE = Path(__file__).parents[2] / "docs" / "tracker-presets.md"
START = "<!-- The rest of this page is made by python -m benchmarks.documents.presets -->\n"


def main() -> None:
    """Replace the tables in the page."""
    written = PAGE.read_text(encoding="utf-8").partition(START)[0]
    PAGE.write_text(written + START + tables(), encoding="utf-8")


def tables() -> str:
    """One section per preset: what differs, and every value with its source."""
    return "".join(f"\n{section}" for section in map(_section, preset_names()))


def _section(name: str) -> str:
    preset = load_preset(name)
    rows = [f"| {option} | {value} | {source} |\n" for option, value, source in _values(name)]
    return "".join(
        [
            f"## {name}\n\n",
            f"{preset.system}: {preset.description}. Read in {preset.repository}, commit {preset.commit}. ",
            f"Tracker: `{preset.tracker}`.\n\n",
            *(f"- {sentence}\n" for sentence in preset.differs),
            "\n| option | value | source |\n|---|---|---|\n",
            *rows,
        ]
    )


def _values(name: str) -> Iterator[tuple[str, str, str]]:
    def walk(table: tomlkit.items.Table, place: str) -> Iterator[tuple[str, str, str]]:
        for key, value in table.items():
            if isinstance(value, tomlkit.items.Table):
                yield from walk(value, f"{place}{key}.")
            else:
                yield f"{place}{key}", value.as_string(), value.trivia.comment.removeprefix("# ")

    yield from walk(tomlkit.parse(preset_text(name))["options"], "")


if __name__ == "__main__":
    main()
