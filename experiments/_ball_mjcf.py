"""The bouncing ball as MuJoCo's and Brax's model: a sphere that slides upright above a plane."""

IMPEDANCE, RADIUS = 0.9999, 0.05
"""Of the constraint, the largest that MuJoCo allows; of the sphere [m]."""
_MODEL = """
<mujoco>
  <option timestep="{dt}" gravity="0 0 -9.81" {solver}iterations="20"/>
  <default>
    <geom solref="-1 -1" solimp="{d} {d} 0.001 0.5 2" {contact}/>
  </default>
  <worldbody>
    <geom type="plane" size="1 1 0.1"/>
    <body>
      <joint type="slide" axis="0 0 1"/>
      <geom type="sphere" size="{radius}" mass="1"/>
    </body>
  </worldbody>
</mujoco>
"""


def ball_model(dt: float, *, contact: str, solver: str = "") -> str:
    """The model in MuJoCo's language, with attributes of its contacts and of the solver."""
    return _MODEL.format(dt=dt, d=IMPEDANCE, radius=RADIUS, contact=contact, solver=solver)
