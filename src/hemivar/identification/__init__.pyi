"""The public names of ``hemivar.identification`` and where each comes from; loaded on first use."""

from .adjoint import Sensitivity as Sensitivity
from .adjoint import sensitivity as sensitivity
from .fit import FitOptions as FitOptions
from .fit import fit as fit
from .identifying import identify as identify
from .measurements import Measurements as Measurements
from .measurements import read_measurements as read_measurements
