"""How the user gives an option of a reader, for the errors that an option avoids."""


def with_option(name: str, value: str) -> str:
    """``--option image_topic=/cam0, or image_topic in [dataset.options]``: on the command line, or in an experiment."""
    return f"--option {name}={value}, or {name} in [dataset.options]"
