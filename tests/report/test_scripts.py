"""The scripts of a page are bundled once, and pages need no cache folder."""

from pathlib import Path

import pytest

from tracknoise.report import figure_files


@pytest.mark.parametrize("writable", [True, False])
def test_scripts_are_kept_where_a_cache_can_be_written(
    writable: bool, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    folder = tmp_path / "cache"
    if not writable:
        folder.write_text("a file, no folder")
    monkeypatch.setattr(figure_files, "user_cache_path", lambda *_, **__: folder)
    figure_files.scripts.cache_clear()
    text = figure_files.scripts()
    assert "vegaEmbed" in text
    assert "</script" not in text
    if writable:
        (kept,) = folder.iterdir()
        assert kept.read_text() == text
        kept.write_text("kept")
        figure_files.scripts.cache_clear()
        assert figure_files.scripts() == "kept"
    figure_files.scripts.cache_clear()
