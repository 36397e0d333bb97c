"""Figures and animation of simulated walks. This is their one import path.

Figures of a motion take the scene and a trajectory that was saved step by step. Figures of a gait,
a law of contact, a branch, a curve of bifurcations, a fit or an optimisation take that object.
Figures of basins take labels, refined boundaries or fractions, and the figure of constraint methods
takes runs. Each function draws into the given axes or figure, or into a new figure, and returns the
figure. None of them uses pyplot, so they all work without a display.

`figure_style("paper")` makes figures as wide as one column of a paper, or two; `save_figure` writes
them as PNG, PDF and SVG with their fonts.
"""

from jaxbiped.plot._basin import basin as basin
from jaxbiped.plot._basin import refined_basin as refined_basin
from jaxbiped.plot._contact_charts import contact_forces as contact_forces
from jaxbiped.plot._contact_charts import penetrations as penetrations
from jaxbiped.plot._figure_style import FIGURE_FORMATS as FIGURE_FORMATS
from jaxbiped.plot._figure_style import FIGURE_STYLES as FIGURE_STYLES
from jaxbiped.plot._figure_style import figure_style as figure_style
from jaxbiped.plot._figure_style import save_figure as save_figure
from jaxbiped.plot._fit_charts import fit as fit
from jaxbiped.plot._fit_charts import fit_data as fit_data
from jaxbiped.plot._fit_charts import optimisation as optimisation
from jaxbiped.plot._gait_charts import elasticities as elasticities
from jaxbiped.plot._gait_charts import multipliers as multipliers
from jaxbiped.plot._laws import bristle_law as bristle_law
from jaxbiped.plot._laws import friction_law as friction_law
from jaxbiped.plot._laws import normal_law as normal_law
from jaxbiped.plot._motion_curves import gait_orbit as gait_orbit
from jaxbiped.plot._motion_curves import leg_angles as leg_angles
from jaxbiped.plot._motion_curves import phase_portrait as phase_portrait
from jaxbiped.plot._motion_curves import rigid_leg_angles as rigid_leg_angles
from jaxbiped.plot._motion_curves import time_series as time_series
from jaxbiped.plot._motion_pictures import animate as animate
from jaxbiped.plot._motion_pictures import animation_html as animation_html
from jaxbiped.plot._motion_pictures import gait_strobe as gait_strobe
from jaxbiped.plot._motion_pictures import save_animation as save_animation
from jaxbiped.plot._motor_torques import motor_torques as motor_torques
from jaxbiped.plot._notebook import notebook_html as notebook_html
from jaxbiped.plot._notebook import walker as walker
from jaxbiped.plot._parameter_charts import basin_fractions as basin_fractions
from jaxbiped.plot._parameter_charts import bifurcation_curves as bifurcation_curves
from jaxbiped.plot._parameter_charts import branch as branch
from jaxbiped.plot._pareto_front import pareto_front as pareto_front
from jaxbiped.plot._work_precision import constraint_runs as constraint_runs
from jaxbiped.plot._work_precision import work_precision as work_precision
from jaxbiped.plot.viewer._playground import Playground as Playground
from jaxbiped.plot.viewer._playground import playground as playground
from jaxbiped.plot.viewer._view import BasinView as BasinView
from jaxbiped.plot.viewer._view import View as View
from jaxbiped.plot.viewer._view import side_by_side as side_by_side
from jaxbiped.plot.viewer._view import view as view
from jaxbiped.plot.viewer._view import view_basin as view_basin
