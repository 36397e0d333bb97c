"""Crossed switches, against steps that cross them; what these have to be exact to."""

import dataclasses

import jax.numpy as jnp
import numpy as np
import pytest

import jaxbiped as jb
from jaxbiped.dynamics import feet
from jaxbiped.hybrid import Switch
from jaxbiped.hybrid._compliant_guards import contact_changes
from jaxbiped.hybrid._scales import units_of
from jaxbiped.solve.controllers._step_size import CrossedSwitches, ErrorControl
from jaxbiped.solve.controllers._switch_locator import _crosses

SCENE = jb.seed_scene()
V0 = float(SCENE.friction.v0)


def _standing(depth=5e-4, slip=0.0, sinks=0.0, other=-0.01):
    """A walker on foot 1 (a leg in stance turns backwards, and its foot may touch)."""
    walker, angle, rate = SCENE.walker, 0.1, -1.0
    reach = walker.l - walker.r
    height = float(walker.r - depth + reach * jnp.cos(angle))
    swing = float(jnp.arccos((height - walker.r - (-other)) / reach))
    state = jb.State(
        hip_x=0.0, hip_z=height, theta_1=angle, theta_2=-swing, hip_vx=0.0, hip_vz=0.0,
        omega_1=rate, omega_2=0.5,
    )  # fmt: skip
    moving = state._replace(
        hip_vx=slip - float(reach * jnp.cos(angle) + walker.r) * rate,
        hip_vz=-sinks - float(reach * jnp.sin(angle)) * rate,
    )
    state = jb.State(*map(jnp.asarray, moving))
    foot = feet(SCENE, state)[0]
    assert foot.penetration == pytest.approx(depth, abs=1e-12)
    assert foot.slip_speed == pytest.approx(slip, abs=1e-12)
    assert foot.penetration_rate == pytest.approx(sinks, abs=1e-12)
    return state


@pytest.mark.parametrize(
    ("before", "after", "crossed"),
    [
        (dict(), dict(), False),
        (dict(slip=0.5 * V0), dict(slip=0.6 * V0), False),
        (dict(slip=0.9 * V0), dict(slip=1.1 * V0), True),
        (dict(slip=-0.9 * V0), dict(slip=-1.1 * V0), True),
        (dict(slip=0.5 * V0), dict(slip=-0.5 * V0), True),
        (dict(slip=20.0 * V0), dict(slip=10.0 * V0), False),
        (dict(slip=20.0 * V0), dict(slip=5.0 * V0), True),
        (dict(slip=5.0 * V0), dict(slip=20.0 * V0), True),
        (dict(depth=-1e-4, sinks=0.1), dict(depth=1e-4, sinks=0.1), True),
        (dict(depth=1e-4), dict(depth=-1e-4), True),
        (dict(depth=1e-5, sinks=0.0), dict(depth=1e-5, sinks=-0.5), True),  # the damper pulls
        (dict(depth=-2e-4, slip=V0), dict(depth=-1e-4, slip=-V0), False),
    ],
)
def test_a_contact_of_another_kind_at_the_end_is_a_crossed_switch(before, after, crossed):
    assert bool(contact_changes(SCENE, _standing(**before), _standing(**after))) is crossed


def test_without_friction_slip_makes_no_difference():
    scene = dataclasses.replace(SCENE, friction=jb.laws.Frictionless())
    slips, turns = _standing(slip=V0), _standing(slip=-V0)
    assert not contact_changes(scene, slips, turns)
    assert contact_changes(scene, slips, _standing(depth=-1e-4))


@pytest.mark.parametrize(("slip", "kept"), [(0.5 * V0, True), (-0.5 * V0, False)])
def test_its_error_counts_as_often_as_told(slip, kept):
    before, after = _standing(slip=0.4 * V0), _standing(slip=slip)
    units = units_of(SCENE, before)
    error = jb.State(*(0.2 * (1e-8 + 1e-6 * abs(leaf)) for leaf in after))
    control = CrossedSwitches(ErrorControl(1e-6, 1e-8, units), jb.hybrid.Walking(), 10.0)
    times = jnp.asarray(0.0), jnp.asarray(1e-3)
    keep, *_ = control.adapt_step_size(*times, before, after, SCENE, error, 4, jnp.asarray(False))
    assert bool(keep) is kept


@pytest.mark.slow
def test_the_draft_is_near_an_independent_solution(reference):
    """Over four heel strikes; were such errors counted once it would be off by 9.5e-4."""
    times, exact = reference
    how = dict(duration=2.0, accuracy="draft", save=times, engine="lanes")
    found = np.stack(jb.simulate(SCENE, jb.seed_state(), **how).state, axis=1)
    np.testing.assert_allclose(found, exact, atol=2e-4)


@pytest.mark.parametrize("resets", [True, False])
@pytest.mark.parametrize("live", [(True, False), (False, True), (False, False)])
def test_each_way_past_a_surface_is_met_in_one_step_alone(resets, live):
    """A motion through zero that a step ends on: the next begins there. Where the state is reset
    the surface counts downwards alone, and only if it is live before."""

    def met(values):
        ends = [Switch(jnp.asarray(v), jnp.asarray(at), resets=resets) for v, at in values]
        return [bool(_crosses(*ends[k : k + 2])) for k in range(len(ends) - 1)]

    begin, end = live
    counts = begin if resets else begin or end
    down, up = (1.0, 0.0, -1.0), (-1.0, 0.0, 1.0)
    assert met([(down[0], begin), (down[1], end)]) == [counts]
    assert met([(down[1], begin), (down[2], end)]) == [False]
    assert met([(up[0], begin), (up[1], end)]) == [False]
    assert met([(up[1], begin), (up[2], end)]) == [counts and not resets]
