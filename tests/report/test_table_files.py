import io
import shutil
import subprocess
from pathlib import Path

import polars as pl
import pytest
from polars.testing import assert_frame_equal

from tracknoise.report.cells import cells
from tracknoise.report.report_data import ReportData
from tracknoise.report.table_files import EXPORTS, escape_latex, to_csv, to_latex
from tracknoise.tables.store import RunFolder

ODD = pl.DataFrame(
    {"name_1": [r"a_b & 50% \x", "$#{}~^<>", None], "value": [1.23456789, None, 2e-7], "n": [1, None, 3]}
)


def test_latex_special_characters_are_escaped() -> None:
    assert escape_latex(r"50%_&$#{}") == r"50\%\_\&\$\#\{\}"
    assert escape_latex("\\~^") == r"\textbackslash{}\textasciitilde{}\textasciicircum{}"


def test_latex_has_a_row_a_row_and_a_dash_for_what_is_missing() -> None:
    lines = to_latex(ODD).splitlines()
    assert lines[0] == r"\begin{tabular}{lrr}"
    assert lines[2] == r"name\_1 & value & n \\"
    assert lines[4] == r"a\_b \& 50\% \textbackslash{}x & 1.235 & 1 \\"
    assert lines[5].endswith(r"& -- & -- \\")
    assert lines[6] == r"-- & 2e-07 & 3 \\"
    assert lines[-1] == r"\end{tabular}"


@pytest.mark.skipif(shutil.which("pdflatex") is None, reason="pdflatex is not installed")
def test_latex_compiles(tmp_path: Path) -> None:
    document = f"\\documentclass{{article}}\\begin{{document}}{to_latex(ODD)}\\end{{document}}"
    (tmp_path / "table.tex").write_text(document)
    subprocess.run(["pdflatex", "-halt-on-error", "table.tex"], cwd=tmp_path, check=True, capture_output=True)


@pytest.mark.parametrize("export", EXPORTS, ids=lambda export: export.id)
def test_csv_comes_back_as_it_was(run: RunFolder, export: object) -> None:
    table = export.make(ReportData.of(run))  # type: ignore[attr-defined]
    assert table.height or export.id not in ("curves", "factor-effects", "intervals", "summary", "zero-mean")
    back = pl.read_csv(io.StringIO(to_csv(table)), schema_overrides=table.schema)
    assert_frame_equal(back, table, check_exact=True)


def test_text_that_a_spreadsheet_would_take_for_a_formula_is_quoted() -> None:
    names = ["=1+1", "+x", "-x", "@x", "\tx", "a=b", "", None]
    table = pl.DataFrame({"name": names, "kind": pl.Series(["-a"] * 8, dtype=pl.Enum(["-a"])), "value": [-1.5] * 8})
    back = pl.read_csv(io.StringIO(to_csv(table)))
    assert back["name"].to_list()[:6] == ["'=1+1", "'+x", "'-x", "'@x", "'\\tx", "a=b"]
    assert back["kind"].unique().to_list() == ["'-a"]
    assert back["value"].to_list() == [-1.5] * 8
    assert to_csv(pl.DataFrame({"=x": [1]})) == "'=x\n1\n"


def test_control_characters_are_escaped_in_table_files() -> None:
    table = pl.DataFrame({"name": ["a\x1b[31m", "two\nlines", "\u202edesrever"]})
    assert to_csv(table) == "name\na\\x1b[31m\ntwo\\nlines\n\\u202edesrever\n"
    assert "\x1b" not in to_latex(table)


def test_latex_rows_that_start_with_a_bracket_are_no_argument_of_the_row_before() -> None:
    assert escape_latex("[2] *x") == "{[}2{]} {*}x"


def test_only_curves_that_are_not_cut_are_exported(run: RunFolder) -> None:
    data = ReportData.of(run)
    assert data["curves"]["cut"].any()
    (curves,) = [export.make(data) for export in EXPORTS if export.id == "curves"]
    assert not curves["cut"].any()
    assert curves["n"].min() >= data.min_features


def test_cells_write_shares_in_percent_and_lengths_in_pixels() -> None:
    table = pl.DataFrame({"outlier_ratio": [0.0483, None], "error_px": [0.12345, None], "n": [1200, None]})
    made = cells(table, {"outlier_ratio": "outliers", "error_px": "error", "n": "tracks"}, "caption")
    assert made.rows == [["4.8\N{NO-BREAK SPACE}%", "0.123", "1,200"], ["–", "–", "–"]]
    assert made.headings == ["outliers", "error", "tracks"]
    assert all(made.numeric)
