"""Solvers: the Rosenbrock family of this project, and all that are known by name."""

from jaxbiped.solve._accuracy import rms_norm as rms_norm
from jaxbiped.solve._solvers import SOLVERS as SOLVERS
from jaxbiped.solve.rosenbrock._rodas_tableaux import Rodas3P as Rodas3P
from jaxbiped.solve.rosenbrock._rodas_tableaux import Rodas4 as Rodas4
from jaxbiped.solve.rosenbrock._rodas_tableaux import Rodas4P as Rodas4P
from jaxbiped.solve.rosenbrock._rodas_tableaux import Rodas5P as Rodas5P
from jaxbiped.solve.rosenbrock._rosenbrock_solver import AbstractRosenbrock as AbstractRosenbrock
from jaxbiped.solve.rosenbrock._rosenbrock_solver import (
    RosenbrockInterpolation as RosenbrockInterpolation,
)
from jaxbiped.solve.rosenbrock._tableau_form import RosenbrockTableau as RosenbrockTableau
