"""``python -m uqmbd``: the command line."""

from uqmbd.cli import main

if __name__ == "__main__":
    main()
