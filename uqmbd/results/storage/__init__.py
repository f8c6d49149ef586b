"""Results in files: netCDF and Zarr, written whole or not at all."""
