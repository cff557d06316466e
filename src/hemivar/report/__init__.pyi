"""The public names of ``hemivar.report`` and where each comes from; loaded on first use."""

from .animation import animate as animate
from .bodies import plot_problem as plot_problem
from .bodies import plot_solution as plot_solution
from .certificate_line import plot_certificate as plot_certificate
from .contact_curves import plot_contact as plot_contact
from .law_figures import plot_law as plot_law
from .law_figures import plot_laws as plot_laws
from .loglog import plot_adaptive as plot_adaptive
from .loglog import plot_errors as plot_errors
from .loglog import plot_history as plot_history
from .loglog import plot_study as plot_study
from .march_figures import Units as Units
from .march_figures import plot_march as plot_march
from .mesh_figures import plot_meshes as plot_meshes
from .path_diagrams import plot_path as plot_path
from .picture import paper as paper
from .plane_body import Arrows as Arrows
from .saving import save as save
from .solution_pictures import plot_solutions as plot_solutions
from .sweep_figures import plot_sweep as plot_sweep
from .tables import Table as Table
from .tables import comparison_table as comparison_table
