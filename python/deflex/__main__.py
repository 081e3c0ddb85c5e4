"""The command: what `deflex` and `python -m deflex` run."""

import sys

from deflex._deflex import main as _main


def main() -> None:
    """Runs the command line of this process and ends with its exit code."""
    sys.exit(_main(["deflex", *sys.argv[1:]]))


if __name__ == "__main__":
    main()
