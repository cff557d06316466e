"""The public names of ``hemivar.identification`` and where each comes from; loaded on first use."""

from .experiment import Experiment as Experiment
from .fit import Fit as Fit
from .fit import FitOptions as FitOptions
from .fit import Parameter as Parameter
from .fit import fit as fit
from .identification_figure import fit_table as fit_table
from .identification_figure import plot_fit as plot_fit
from .identifying import identify as identify
from .identifying import identifying as identifying
from .measurements import Measurements as Measurements
from .measurements import read_measurements as read_measurements
from .sensitivity import derivative_by_law as derivative_by_law
