"""What to run: settings, plan, execution and presets."""
