"""Attempted steps and time of rigid walks with knees beside the seed's rigid walk.

Writes modes_speed.png. Times are of the processor, all threads together; walkers take turns.
"""

import dataclasses
import time

import jax
import jax.numpy as jnp
import numpy as np
from _experiment import Options, experiment
from _pictures import label
from _timing import seconds_of

import jaxbiped as jb
from jaxbiped.plot.style import new_figure

FOOTSTEPS = 10
COUNT, QUICK_COUNT = 1024, 32
"""Walks of each walker in one call."""
ROUNDS, QUICK_ROUNDS = 9, 1
SCATTER = 1e-3
"""Of the rates at the start, as a share of themselves."""
SEED = "seed"
PLAIN = dict(parameters=(), radius_sensitivities=False)


@experiment
def main(options: Options):
    count = options.sized(COUNT, QUICK_COUNT)
    work = {name: walks_of(*each, count) for name, each in walkers().items()}
    found = {name: run() for name, run in work.items()}
    rounds = options.sized(ROUNDS, QUICK_ROUNDS)
    seconds = seconds_of(work, rounds, warm=False, clock=time.process_time)
    rows = [
        {
            "walker": name,
            "accepted": float(np.mean(walks.accepted)),
            "rejected": float(np.mean(walks.rejected)),
            "walked": float(np.mean(np.asarray(walks.ending) == int(jb.Ending.WALKING))),
            "cpu_s_a_walk": seconds[name] / count,
            "ratio": seconds[name] / seconds[SEED],
        }
        for name, walks in found.items()
    ]
    return {"footsteps": FOOTSTEPS, "rows": rows, "picture": draw(options, rows)}


def walkers():
    """Of each walker the scene and a start on its gait, by name."""
    seed, kneed = jb.seed_scene(), jb.models.mcgeer(knees=True)
    scenes = {
        SEED: jb.RigidScene(seed.walker, seed.ground),
        "Hsu Chen": jb.models.hsu_chen(),
        "McGeer, knees": jb.RigidScene(
            dataclasses.replace(kneed.walker, holds="until heel strike"), kneed.ground
        ),
    }
    guess = scenes["Hsu Chen"].state(**jb.models.MODELS["hsu-chen"].starts["gait"])
    guesses = {"Hsu Chen": guess}
    return {
        name: (scene, jb.find_gait(scene, guesses.get(name), **PLAIN).measures.state)
        for name, scene in scenes.items()
    }


def walks_of(scene, state, count):
    """A call that walks from starts about a gait; what is held keeps its rates alike."""
    names, begin = state._fields, np.array([float(leaf) for leaf in state])
    noise = SCATTER * np.random.default_rng(0).standard_normal((len(names), count))
    starts = np.repeat(begin[:, None], count, axis=1)
    for i, name in enumerate(names):
        if name.startswith("omega"):
            like = name.replace("shank_2", "thigh_2")
            starts[i] *= 1.0 + noise[names.index(like)]

    def one(*values):
        how = dict(footsteps=FOOTSTEPS, save="end", engine="lanes")
        return jb.simulate(scene, type(state)(*values), **how)

    batch, columns = jax.vmap(one), tuple(map(jnp.asarray, starts))
    return lambda: batch(*columns)


def draw(options: Options, rows):
    figure = new_figure(8.0, 3.5)
    left, right = figure.subplots(1, 2)
    names = [row["walker"] for row in rows]
    left.bar(names, [row["accepted"] + row["rejected"] for row in rows])
    label(left, "", "attempted steps of a walk")
    right.bar(names, [row["ratio"] for row in rows])
    label(right, "", "processor time over the seed's")
    return options.save(figure, "modes_speed.png")


if __name__ == "__main__":
    main()
