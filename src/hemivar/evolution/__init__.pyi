"""The public names of ``hemivar.evolution`` and where each comes from; loaded on first use."""

from .evolution_problem import Evolution as Evolution
from .history import History as History
from .march import march as march
from .march_events import BondBroken as BondBroken
from .march_events import MarginLost as MarginLost
from .march_events import Release as Release
from .march_events import Slip as Slip
from .march_events import Touch as Touch
from .march_events import When as When
from .march_state import Checkpoint as Checkpoint
from .plan import March as March
from .save import Save as Save
from .schemes import BDF2 as BDF2
from .schemes import SDIRK2 as SDIRK2
from .schemes import GeneralizedAlpha as GeneralizedAlpha
from .schemes import ImplicitEuler as ImplicitEuler
from .schemes import Midpoint as Midpoint
from .schemes import MoreauJean as MoreauJean
from .schemes import Newmark as Newmark
from .schemes import Scheme as Scheme
from .steps import AdaptiveStep as AdaptiveStep
from .steps import FixedStep as FixedStep
