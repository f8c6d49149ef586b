# chaospy has no types, and pyright takes defaults that it reads in its sources for them: Normal(mu=0) for an int.
from typing import Any

def __getattr__(name: str) -> Any: ...
