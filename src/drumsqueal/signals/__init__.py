"""What a recorded motion says: spectra, growth rates and the regime; arrays in, arrays out."""

from drumsqueal.signals.growth import Growth, fit_growth, modal_amplitudes, modal_frequency
from drumsqueal.signals.regime import PERIODS_NEEDED, STEADY, Regime, classify
from drumsqueal.signals.spectra import (
    Peak,
    Peaks,
    Spectrogram,
    Spectrum,
    amplitude_spectrum,
    peak_near,
    spectral_peaks,
    spectrogram,
)

__all__ = [
    "PERIODS_NEEDED",
    "STEADY",
    "Growth",
    "Peak",
    "Peaks",
    "Regime",
    "Spectrogram",
    "Spectrum",
    "amplitude_spectrum",
    "classify",
    "fit_growth",
    "modal_amplitudes",
    "modal_frequency",
    "peak_near",
    "spectral_peaks",
    "spectrogram",
]
