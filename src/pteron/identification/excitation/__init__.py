"""Exciting trajectories: periodic motions whose forces determine the base parameters well."""

from pteron.identification.excitation.conditioning import (
    Conditioning,
    conditioning,
    scaled_condition,
    stacked_regressor,
)
from pteron.identification.excitation.excitation import Excitation, Start
from pteron.identification.excitation.fourier import FourierMotion
from pteron.identification.excitation.held_out import RepeatedCycle, held_out_cycle
from pteron.identification.excitation.layout import Layout, check_sampling
from pteron.identification.excitation.leads import Lead, LedMotion, found_lead
from pteron.identification.excitation.limits import Limits
from pteron.identification.excitation.margins import Margin, Margins, margins
from pteron.identification.excitation.motion_files import motion_paths
from pteron.identification.excitation.random_motions import random_excitation
from pteron.identification.excitation.search import optimal_excitation

__all__ = [
    "Conditioning",
    "Excitation",
    "FourierMotion",
    "Layout",
    "Lead",
    "LedMotion",
    "Limits",
    "Margin",
    "Margins",
    "RepeatedCycle",
    "Start",
    "check_sampling",
    "conditioning",
    "found_lead",
    "held_out_cycle",
    "margins",
    "motion_paths",
    "optimal_excitation",
    "random_excitation",
    "scaled_condition",
    "stacked_regressor",
]


def __dir__() -> list[str]:
    return sorted(__all__)
