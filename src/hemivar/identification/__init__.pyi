"""The public names of ``hemivar.identification`` and where each comes from; loaded on first use."""

from .fit import FitOptions as FitOptions
from .fit import fit as fit
from .identifying import identify as identify
from .measurements import Measurements as Measurements
from .measurements import read_measurements as read_measurements
