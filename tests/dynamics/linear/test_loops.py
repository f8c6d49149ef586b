"""Bodies in no loop: by the definition, over random links."""

from __future__ import annotations

import itertools
import random

from uqmbd.dynamics.linear.programs import bodies_in_no_loop


def kept(bodies, links):
    """Bodies of the largest set each of which is in two links to others of it or the ground, or in a link of three."""
    for size in range(bodies, -1, -1):
        for chosen in itertools.combinations(range(bodies), size):
            some = {*chosen, -1}
            inside = [x for x in links if len(x) > 2 or x <= some]
            if all(sum(k in x for x in inside) > 1 or any(k in x and len(x) > 2 for x in inside) for k in chosen):
                return set(chosen)
    raise AssertionError


def test_bodies_in_loops_are_distinguished():
    rng = random.Random(1)
    for _ in range(400):
        bodies = rng.randint(1, 7)
        links = [
            set(rng.sample(range(-1, bodies), min(bodies + 1, rng.choice([2, 2, 2, 2, 2, 3]))))
            for _ in range(rng.randint(0, bodies + 2))
        ]
        tree = bodies_in_no_loop(bodies, links)
        assert {k for k in range(bodies) if not tree[k]} == kept(bodies, links), links


def test_each_link_of_a_chain_is_looked_at_a_few_times():
    class Counted(set):
        looks = 0

        def __sub__(self, other):
            Counted.looks += 1
            return set(self) - other

        def __len__(self):
            Counted.looks += 1
            return super().__len__()

        def __contains__(self, item):
            Counted.looks += 1
            return super().__contains__(item)

    for order in (1, -1):
        Counted.looks = 0
        links = [Counted({k - 1, k}) for k in range(2000)][::order]
        assert bodies_in_no_loop(2000, links).all()
        assert Counted.looks < 10 * 2000
