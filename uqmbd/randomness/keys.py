"""Keys of sampled paths of random processes."""

from __future__ import annotations

from uqmbd.names import check_name, checked
from uqmbd.randomness.variable import JointDistribution, RandomVariable

__all__ = ["path_key"]


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
    Results do not depend smoothly on a key.  A method that only samples its inputs may declare that it accepts keys
    (`uqmbd.extend.Propagator.accepts_keys`). All other methods reject keys.

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
