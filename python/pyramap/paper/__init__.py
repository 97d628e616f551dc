"""Every figure and table of the paper, repeated with this library: `pyramap paper -o DIR`.

One file a figure: `compute` makes the data, `draw` a picture of them, `section` gathers what the page needs. `texts`
say what is to be seen and what differs from the paper. `reproduction` is the table of contents.
"""

from .effort import FULL, QUICK, Effort
from .reproduction import PAGE, RESULTS, Reproduction, reproduce

__all__ = ["FULL", "PAGE", "QUICK", "RESULTS", "Effort", "Reproduction", "reproduce"]
