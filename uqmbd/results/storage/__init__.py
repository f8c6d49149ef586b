"""Store results in netCDF files, and many samples in Zarr folders; every write is atomic."""

import lazy_loader

__getattr__, __dir__, __all__ = lazy_loader.attach_stub(__name__, __file__)
