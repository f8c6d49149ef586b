"""Store the pictures of the gallery from the last runs of its studies, or compare them with these runs."""

from __future__ import annotations

import sys
from pathlib import Path

from uqmbd_site.gallery import changed_pictures, store_pictures


def main() -> None:
    """Read the command line: ``store`` or ``compare``."""
    source = Path(__file__).parents[2]
    if sys.argv[1:] == ["store"]:
        print("\n".join(store_pictures(source)))
    elif sys.argv[1:] == ["compare"]:
        changed = changed_pictures(source)
        sys.exit(f"Stored pictures that differ from those of the last runs: {', '.join(changed)}." if changed else 0)
    else:
        sys.exit("Usage: python -m uqmbd_site store|compare")


main()
