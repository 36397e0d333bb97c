"""Widget of the viewer for notebooks, by anywidget. Imported where one is asked for."""

import anywidget
import traitlets

from jaxbiped.plot.viewer._page import style, widget_script


class ViewWidget(anywidget.AnyWidget):
    """A view in a notebook.

    Attributes:
        sent: what is shown, as `View.sent` gives it.
        time: where the clock rests [s].
    """

    _esm = widget_script()
    _css = style()
    sent = traitlets.Dict().tag(sync=True)
    time = traitlets.Float(0.0).tag(sync=True)
