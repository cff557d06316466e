"""Problems with known answers, of the survey and of the literature, static and in time.

Every function returns one value that may be given wherever a problem or an evolution is asked for (``hv.solve``,
``hv.discretize``, ``hv.march``, ...): a statement, for bars a discrete problem, or, where the solution is known, a
:class:`~hemivar.basics.known_statement.ManufacturedProblem` that holds it beside its ``statement``.
"""

from hemivar.gallery.evolution_examples import SCREWED_ARCH_DATA, ScrewedArchData, screwed_arch, viscoelastic_beam
from hemivar.gallery.known import (
    BEAM_DISPLACEMENTS,
    KnownProblem,
    beam,
    elastic_bar,
    elastic_bar_penetrations,
    manufactured_spring,
    weighted_block,
)
from hemivar.gallery.known_evolutions import (
    EarthquakeSlider,
    KnownEvolution,
    StickSlip,
    VelocityStep,
    bonded_block,
    bounce,
    bouncing_block,
    jumping_block,
    penetration_memory_block,
    relaxing_block,
    sliding_block,
    wearing_block,
)
from hemivar.gallery.moving_bodies import (
    CANTILEVER,
    ManufacturedMotion,
    MindlinSphere,
    bar_on_wall,
    moving_bar,
    thrown_bar,
    viscoelastic_cantilever,
)
from hemivar.gallery.nonlinear_bodies import HenckyConstants, hencky_block, hencky_ring
from hemivar.gallery.nonmonotone import (
    broken_foundation,
    delamination,
    manufactured_softening,
    shear_block,
    shear_block_slips,
    shear_column,
    softening_block,
)
from hemivar.gallery.scalar_problems import KnownScalarProblem, antiplane_friction, membrane_obstacle, membrane_radius
from hemivar.gallery.survey_problems import (
    SURVEY_DATA,
    SurveyData,
    survey,
    survey_cube,
    survey_cube_logarithmic,
    survey_logarithmic,
)
from hemivar.gallery.thermal_problems import WarmBody, thermoviscoelastic

__all__ = [
    "BEAM_DISPLACEMENTS",
    "CANTILEVER",
    "SCREWED_ARCH_DATA",
    "SURVEY_DATA",
    "EarthquakeSlider",
    "HenckyConstants",
    "KnownEvolution",
    "KnownProblem",
    "KnownScalarProblem",
    "ManufacturedMotion",
    "MindlinSphere",
    "ScrewedArchData",
    "StickSlip",
    "SurveyData",
    "VelocityStep",
    "WarmBody",
    "antiplane_friction",
    "bar_on_wall",
    "beam",
    "bonded_block",
    "bounce",
    "bouncing_block",
    "broken_foundation",
    "delamination",
    "elastic_bar",
    "elastic_bar_penetrations",
    "hencky_block",
    "hencky_ring",
    "jumping_block",
    "manufactured_softening",
    "manufactured_spring",
    "membrane_obstacle",
    "membrane_radius",
    "moving_bar",
    "penetration_memory_block",
    "relaxing_block",
    "screwed_arch",
    "shear_block",
    "shear_block_slips",
    "shear_column",
    "sliding_block",
    "softening_block",
    "survey",
    "survey_cube",
    "survey_cube_logarithmic",
    "survey_logarithmic",
    "thermoviscoelastic",
    "thrown_bar",
    "viscoelastic_beam",
    "viscoelastic_cantilever",
    "wearing_block",
    "weighted_block",
]
