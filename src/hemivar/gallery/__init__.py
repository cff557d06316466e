"""Problems with known answers, of the survey and of the literature."""

from hemivar.gallery.known import (
    BEAM_DISPLACEMENTS,
    KnownProblem,
    beam,
    elastic_bar,
    elastic_bar_penetrations,
    manufactured_spring,
    weighted_block,
)
from hemivar.gallery.nonmonotone import (
    broken_foundation,
    delamination,
    manufactured_softening,
    shear_block,
    shear_block_slips,
    shear_column,
    softening_block,
)
from hemivar.gallery.survey_problems import (
    SURVEY_DATA,
    SurveyData,
    survey,
    survey_cube,
    survey_cube_logarithmic,
    survey_logarithmic,
)

__all__ = [
    "BEAM_DISPLACEMENTS",
    "SURVEY_DATA",
    "KnownProblem",
    "SurveyData",
    "beam",
    "broken_foundation",
    "delamination",
    "elastic_bar",
    "elastic_bar_penetrations",
    "manufactured_softening",
    "manufactured_spring",
    "shear_block",
    "shear_block_slips",
    "shear_column",
    "softening_block",
    "survey",
    "survey_cube",
    "survey_cube_logarithmic",
    "survey_logarithmic",
    "weighted_block",
]
