"""Integration without events: explicit and implicit steps of the driver, and implicit integration by IDA."""

import lazy_loader

__getattr__, __dir__, __all__ = lazy_loader.attach_stub(__name__, __file__)
