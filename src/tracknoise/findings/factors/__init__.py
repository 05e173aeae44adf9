"""Does a factor matter: paired within scenes, the largest of many differences, with a verdict."""
