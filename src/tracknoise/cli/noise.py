"""``tracknoise noise``: noise models, for estimators."""

import typer

from tracknoise.cli import noise_export


def register(app: typer.Typer) -> None:
    """Add the commands."""
    noise = typer.Typer(no_args_is_help=True)
    noise_export.register(noise)
    app.add_typer(noise, name="noise", help="Fit noise models to a run, and export them to estimators.")
