"""Laws from measurements: parameters of a contact law that fit a measured curve, and what the curve leaves open."""

from hemivar.identification.experiment import Experiment
from hemivar.identification.fit import Fit, FitOptions, Parameter, fit
from hemivar.identification.measurements import Measurements, read_measurements
from hemivar.identification.sensitivity import derivative_by_law

__all__ = [
    "Experiment",
    "Fit",
    "FitOptions",
    "Measurements",
    "Parameter",
    "derivative_by_law",
    "fit",
    "read_measurements",
]
