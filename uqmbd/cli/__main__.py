"""Run the command line by `python -m uqmbd.cli`."""

from __future__ import annotations

from uqmbd.cli.app import main

if __name__ == "__main__":
    main()
