"""Figures, tables and the HTML page, made from the run folder and the statistics alone."""
