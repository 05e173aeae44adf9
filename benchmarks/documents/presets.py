"""The presets in docs/trackers.md, listed again from their files.

python -m benchmarks.documents.presets
"""

from pathlib import Path

from tracknoise.trackers.tracker_registry import load_preset, preset_names

PAGE = Path(__file__).parents[2] / "docs" / "trackers.md"
START = "<!-- The rest of this page is made by python -m benchmarks.documents.presets -->\n"


def main() -> None:
    """Replace the list in the page."""
    written = PAGE.read_text(encoding="utf-8").partition(START)[0]
    PAGE.write_text(written + START + tables(), encoding="utf-8")


def tables() -> str:
    """One row per preset: its system, the kind of tracker, and what it is."""
    return "\n| Preset | Of | Kind | What it does |\n| --- | --- | --- | --- |\n" + "".join(map(_row, preset_names()))


def _row(name: str) -> str:
    preset = load_preset(name)
    return f"| `{name}` | {preset.system} | `{preset.tracker}` | {preset.description} |\n"


if __name__ == "__main__":
    main()
