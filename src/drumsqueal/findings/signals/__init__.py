"""Analysis of a recorded motion: spectra, lines, growth rates and the regime; arrays in, arrays out."""

from drumsqueal.findings.signals.decibels import level_dB, level_reference
from drumsqueal.findings.signals.fundamentals import Fundamentals, find_fundamentals
from drumsqueal.findings.signals.growth import Growth, fit_growth, modal_amplitudes, modal_frequency
from drumsqueal.findings.signals.lines import Lines, find_lines
from drumsqueal.findings.signals.regime import PERIODS_NEEDED, STEADY, Regime, classify
from drumsqueal.findings.signals.regime_words import written_frequencies
from drumsqueal.findings.signals.resampling import resample
from drumsqueal.findings.signals.sound import Sound, to_sound, wav_bytes
from drumsqueal.findings.signals.spectra import (
    Peak,
    Peaks,
    Ridge,
    Spectrogram,
    Spectrum,
    amplitude_spectrum,
    follow_line,
    peak_near,
    spectral_peaks,
    spectrogram,
    spectrogram_pieces,
)
from drumsqueal.findings.signals.tones import Harmonic, Tones, find_harmonics, find_tones

__all__ = [
    "PERIODS_NEEDED",
    "STEADY",
    "Fundamentals",
    "Growth",
    "Harmonic",
    "Lines",
    "Peak",
    "Peaks",
    "Regime",
    "Ridge",
    "Sound",
    "Spectrogram",
    "Spectrum",
    "Tones",
    "amplitude_spectrum",
    "classify",
    "find_fundamentals",
    "find_harmonics",
    "find_lines",
    "find_tones",
    "fit_growth",
    "follow_line",
    "level_dB",
    "level_reference",
    "modal_amplitudes",
    "modal_frequency",
    "peak_near",
    "resample",
    "spectral_peaks",
    "spectrogram",
    "spectrogram_pieces",
    "to_sound",
    "wav_bytes",
    "written_frequencies",
]
