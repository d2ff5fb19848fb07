"""The catalogue: one file per effect, the built-in ones in an explicit tuple."""

from .ambient import Ambient
from .base import Choice, Effect, Parameter, Values
from .coolant_heat import CoolantHeat
from .cooling_switch import CoolingSwitch
from .cyclic_load import CyclicLoad
from .friction_decay import FrictionDecay
from .load_step import LoadStep
from .neighbour_heat import NeighbourHeat
from .nonlinear_loss import NonlinearLoss
from .reading_jump import ReadingJump
from .room_step import RoomStep
from .second_mode import SecondMode
from .sensor_drift import SensorDrift
from .sensor_lag import SensorLag
from .transport_delay import TransportDelay

BUILT_IN: tuple[type[Effect], ...] = (
    Ambient,
    SecondMode,
    LoadStep,
    CoolingSwitch,
    RoomStep,
    SensorLag,
    TransportDelay,
    NonlinearLoss,
    NeighbourHeat,
    CyclicLoad,
    FrictionDecay,
    SensorDrift,
    ReadingJump,
    CoolantHeat,
)

__all__ = ["BUILT_IN", "Choice", "Effect", "Parameter", "Values"]
