"""Exciting trajectories: periodic motions from whose forces the base parameters are seen well."""

from pteron.identification.excitation.conditioning import (
    Conditioning,
    conditioning,
    scaled_condition,
    stacked_regressor,
)
from pteron.identification.excitation.draws import random_excitation
from pteron.identification.excitation.fourier import FourierMotion
from pteron.identification.excitation.limits import Limits, Margin, Margins, margins
from pteron.identification.excitation.result import Excitation, Start, check_sampling
from pteron.identification.excitation.search import optimal_excitation

__all__ = [
    "Conditioning",
    "Excitation",
    "FourierMotion",
    "Limits",
    "Margin",
    "Margins",
    "Start",
    "check_sampling",
    "conditioning",
    "margins",
    "optimal_excitation",
    "random_excitation",
    "scaled_condition",
    "stacked_regressor",
]
