"""Statistics and findings of a whole run, from the tables of its sequences."""
