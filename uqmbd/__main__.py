"""Command line as ``python -m uqmbd``."""

from uqmbd.cli import main

if __name__ == "__main__":
    main()
