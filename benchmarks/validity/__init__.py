"""Whether the instrument measures what it says: each file is a script that prints a table."""
