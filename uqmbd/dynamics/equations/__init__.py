"""From a mechanism's terms to compiled equations: derivation, kernels, and the model that holds them."""
