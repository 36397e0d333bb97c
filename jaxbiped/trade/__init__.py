"""Work and precision: what each way of solving costs, and how far off it ends."""

from jaxbiped.trade._cheapest import cheapest as cheapest
from jaxbiped.trade._cheapest import cost_at as cost_at
from jaxbiped.trade._gait_trade import GaitTrade as GaitTrade
from jaxbiped.trade._row import Row as Row
from jaxbiped.trade._row import failed_row as failed_row
from jaxbiped.trade._row import row_of as row_of
from jaxbiped.trade._truth import Truth as Truth
from jaxbiped.trade._truth import truth_of as truth_of
from jaxbiped.trade._walk_trade import WalkTrade as WalkTrade
from jaxbiped.trade._way import Way as Way
from jaxbiped.trade._work import Work as Work
from jaxbiped.trade._work import work_of as work_of
