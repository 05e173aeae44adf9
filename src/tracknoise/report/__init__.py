"""Figures, tables and the HTML page, made only from a run folder."""
