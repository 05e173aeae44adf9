"""From the tables of single sequences to the statistics and findings of the whole run."""
