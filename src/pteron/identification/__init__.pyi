from pteron.identification import (
    consistency as consistency,
    estimators as estimators,
    excitation as excitation,
    logs as logs,
    signals as signals,
)
from pteron.identification.consistency import (
    Bounds as Bounds,
    Consistency as Consistency,
    consistent_model as consistent_model,
)
from pteron.identification.drive_gains import (
    DriveGains as DriveGains,
    identify_drive_gains as identify_drive_gains,
)
from pteron.identification.errors import LogError as LogError
from pteron.identification.estimators import (
    Essential as Essential,
    Estimate as Estimate,
    Reduced as Reduced,
    column_errors as column_errors,
    essential_parameters as essential_parameters,
    halves as halves,
    huber as huber,
    independent_columns as independent_columns,
    instrumental as instrumental,
    maximum_likelihood as maximum_likelihood,
    ordinary as ordinary,
    total as total,
    weighted_least_squares as weighted_least_squares,
)
from pteron.identification.excitation import (
    Excitation as Excitation,
    FourierMotion as FourierMotion,
    Limits as Limits,
    optimal_excitation as optimal_excitation,
    random_excitation as random_excitation,
)
from pteron.identification.faults import (
    FaultIsolation as FaultIsolation,
    IsolatedFault as IsolatedFault,
)
from pteron.identification.fitting import METHODS as METHODS
from pteron.identification.identify import identify as identify
from pteron.identification.logs import (
    Log as Log,
    open_log as open_log,
    read_log as read_log,
    write_log as write_log,
)
from pteron.identification.model import (
    Model as Model,
    Terms as Terms,
    identification_model as identification_model,
)
from pteron.identification.observation import (
    Observations as Observations,
    observations_of as observations_of,
    stack_observations as stack_observations,
)
from pteron.identification.own_regressor import (
    RegressorFit as RegressorFit,
    estimate as estimate,
)
from pteron.identification.payload import (
    Payload as Payload,
    identify_payload as identify_payload,
)
from pteron.identification.prediction import Prediction as Prediction
from pteron.identification.result import Identification as Identification
from pteron.identification.signals import (
    Preprocessing as Preprocessing,
    Processing as Processing,
    States as States,
    preprocessing_for_log as preprocessing_for_log,
)
from pteron.identification.transmissions import (
    Transmissions as Transmissions,
    identify_transmissions as identify_transmissions,
)
from pteron.verdict import Verdict as Verdict
