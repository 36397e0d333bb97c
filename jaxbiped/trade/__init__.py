"""Work and precision: what each way of solving costs, and how far off it ends."""

from jaxbiped.trade._trades import GaitTrade as GaitTrade
from jaxbiped.trade._trades import Row as Row
from jaxbiped.trade._trades import Truth as Truth
from jaxbiped.trade._trades import WalkTrade as WalkTrade
from jaxbiped.trade._trades import Way as Way
from jaxbiped.trade._trades import Work as Work
from jaxbiped.trade._trades import cheapest as cheapest
from jaxbiped.trade._trades import cost_at as cost_at
from jaxbiped.trade._trades import failed_row as failed_row
from jaxbiped.trade._trades import row_of as row_of
from jaxbiped.trade._trades import truth_of as truth_of
from jaxbiped.trade._trades import work_of as work_of
