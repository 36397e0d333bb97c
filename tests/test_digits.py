"""Digits of walks and searches, against the same by other kernels of BLAS."""

import os
import subprocess
import sys

import pytest

CODE = """
import jax
import jaxbiped as jb
from tests.rigid_walkers import rigid_seed

def told(*trees):
    print(*(float(x).hex() for leaf in jax.tree.leaves(trees) for x in leaf.ravel()))

for accuracy in ("draft", "balanced"):
    walk = jb.simulate(jb.seed_scene(), jb.seed_state(), duration=0.5, accuracy=accuracy)
    told(walk.t, walk.state)
how = dict(parameters=(), radius_sensitivities=False)
for scene in (rigid_seed(0.02), jb.seed_scene(slope=0.02)):
    gait = jb.find_gait(scene, **how)
    told(gait.history, gait.measures.period, gait.measures.state, gait.return_jacobian)
"""


@pytest.mark.nightly
def test_no_step_depends_on_the_kernels_of_blas():
    """Kernels of 2004 and of 2013 sum in other orders; elsewhere than on x86 both are one."""
    found = []
    for kernels in ("PRESCOTT", "HASWELL"):
        chosen = os.environ | {"OPENBLAS_CORETYPE": kernels, "JAXBIPED_CACHE": ""}
        run = subprocess.run(
            [sys.executable, "-c", CODE], env=chosen, capture_output=True, text=True, check=True
        )
        found.append(run.stdout.splitlines())
    assert len(found[0]) == 4
    assert found[0] == found[1]
