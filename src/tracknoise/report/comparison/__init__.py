"""A comparison of runs for readers: words, tables, Markdown and a page."""
