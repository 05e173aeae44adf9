"""Factor effects: differences paired within scenes, the largest of them, and a verdict."""
