"""``python -m falsifier``: the command line, for when ``falsifier`` is not on the path."""

from falsifier.cli import main

if __name__ == "__main__":
    main()
