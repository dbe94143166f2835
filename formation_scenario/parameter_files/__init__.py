"""Parameter files of real aircraft, as ground stations save them: `model: {parameters: plane.parm}`.

`text` reads them, `arduplane` and `px4` make a vehicle's model of one, and `of_file` is what the scenario calls.
"""

from formation_scenario.parameter_files.model_of_parameters import ParameterModel, model_of, of_file
from formation_scenario.parameter_files.text import Parameter, ParameterFile, ParameterFileError, read_parameters

__all__ = [
    "Parameter",
    "ParameterFile",
    "ParameterFileError",
    "ParameterModel",
    "model_of",
    "of_file",
    "read_parameters",
]
