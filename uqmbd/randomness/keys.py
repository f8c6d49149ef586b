"""Keys of sampled paths of random processes."""

from __future__ import annotations

import numpy as np

from uqmbd.arguments import typechecked
from uqmbd.errors import StudyError
from uqmbd.names import check_name, checked
from uqmbd.randomness.variable import JointDistribution, RandomVariable
from uqmbd.typing import Array

__all__ = ["combined_paths", "path_key", "path_terms"]


@checked
def path_key(name: str) -> RandomVariable:
    """Return the key of sampled paths: a random variable between 0 and 1, each value of which selects another path.

    Parameters
    ----------
    name : str
        Name of the random process, which is then an input of mechanisms.

    Returns
    -------
    RandomVariable
        Key with a uniform distribution. The value 0 means no path, but the mean of the process.

    Raises
    ------
    uqmbd.StudyError
        If the name is invalid.

    Notes
    -----
    Results do not depend smoothly on a key. A method that samples its inputs, or averages over paths, declares it
    (`uqmbd.extend.InputTreatment`). All other methods reject keys.

    Examples
    --------
    >>> import uqmbd
    >>> key = uqmbd.extend.path_key("road")
    >>> key.is_key, key.mean, key.description
    (True, 0.5, 'key of a sampled path')
    """
    import chaospy

    check_name(name, "random process")
    return RandomVariable._member(JointDistribution(chaospy.Uniform(0, 1), (name,), ("1",), key=True), 0)


@typechecked(values=False)
def combined_paths(values: Array, keys: Array, weights: Array) -> Array:
    """Return inputs whose sampled paths are weighted sums of the paths of several keys.

    Sampled paths are Gaussian. A sum of independent paths with weights whose squares add up to one is therefore another
    path of the same process. Methods that move through the space of the noise, such as subset simulation, replace a
    path ``w`` by ``sqrt(1 - s^2) w + s w'`` with a new path ``w'``.

    Parameters
    ----------
    values : array, shape (K, input)
        Inputs, in the order of ``problem.inputs.names``. Their own keys have no effect, but must be positive.
    keys : array, shape (K, process, M)
        Keys of the paths, for each random process in the order of the inputs.
    weights : array, shape (K, process, M)
        Weights of the paths; a weight of zero omits a path.

    Returns
    -------
    array, shape (K, input + 2 process M)
        Inputs for `uqmbd.extend.Problem.realise` and ``margins``.

    Raises
    ------
    uqmbd.StudyError
        If the shapes differ.

    Examples
    --------
    >>> import numpy as np
    >>> import uqmbd
    >>> keys, weights = np.array([[[0.2, 0.7]]]), np.array([[[0.8, 0.6]]])
    >>> uqmbd.extend.combined_paths(np.array([[1.5, 0.2]]), keys, weights).tolist()
    [[1.5, 0.2, 0.2, 0.7, 0.8, 0.6]]
    """
    if keys.ndim != 3 or keys.shape != weights.shape or len(keys) != len(values):
        raise StudyError(
            f"combined_paths: values, keys and weights have the shapes {values.shape}, {keys.shape} and "
            f"{weights.shape}; expected (K, input), (K, process, M) and (K, process, M)."
        )
    return np.concatenate([values, keys.reshape(len(values), -1), weights.reshape(len(values), -1)], axis=1)


def path_terms(values: Array, inputs: int, families: int) -> tuple[Array, Array, Array]:
    """Return inputs (K, input), and the keys and weights (K, family, M) of combined paths; M = 0 without them."""
    more = values[:, inputs:]
    keys, weights = np.split(more, 2, axis=1)
    shape = (len(values), families, more.shape[1] // (2 * families) if families else 0)
    return values[:, :inputs], keys.reshape(shape), weights.reshape(shape)
