"""`python -m tracknoise`, where the script is not on the path."""

from tracknoise.cli.app import main

if __name__ == "__main__":  # not in a process that starts anew to measure a part
    main()
