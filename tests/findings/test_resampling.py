"""Values between samples: lines keep amplitude and phase, also at the ends; what would fold is stopped; sound."""

import io
import struct
import wave

import numpy as np
import pytest

from drumsqueal.findings.signals.sound import PASSES, STOPS, fraction_above, reach, resample, to_sound, wav_bytes

RECORDED = 50e3  # Hz
TIME = np.arange(3000) / RECORDED
RATES = [44.1e3, 4 * 44.1e3, 20e3, 12345.678, 8e3]


def times_at(rate):
    return np.arange(int(TIME[-1] * rate) + 1) / rate


@pytest.mark.thorough(but=["20000.0"])
@pytest.mark.parametrize("rate", RATES)
def test_growing_lines_keep_amplitude_and_phase_to_their_very_ends(rate):
    frequencies = np.array([0.0, 0.01, 0.1, 0.3, PASSES - 0.001]) * min(rate, RECORDED)

    def lines(t):
        t = t[:, None]
        return np.exp(76 * t) * np.cos(2 * np.pi * frequencies * t + 0.7)  # they grow as the nominal scene does

    times = times_at(rate)
    found = resample(3 + lines(TIME), RECORDED, times, rate)
    # 5e-5 is what the filter is made for in its band; an error of amplitude or of phase (rad) would show as large.
    assert np.all(np.abs(found - 3 - lines(times)) < 5e-5 * np.exp(76 * times[:, None]) + 3 * 1e-5)


@pytest.mark.parametrize("rate", [44.1e3, 20e3, 12345.678, 8e3])
def test_what_would_fold_is_stopped(rate):
    frequencies = np.linspace(STOPS * rate, RECORDED / 2, 5)[:-1]
    lines = np.cos(2 * np.pi * frequencies * TIME[:, None] + 0.7)
    assert np.abs(resample(lines, RECORDED, times_at(rate), rate)).max() < 1e-5  # 100 dB


def test_a_rate_of_many_lines_is_none_the_worse_at_the_ends():
    random = np.random.default_rng(3)
    frequency, phase, size = random.uniform(10, 8000, 20), random.uniform(0, 6, 20), 10 ** random.uniform(-3, 0, 20)

    def lines(t):
        return (size * np.cos(2 * np.pi * frequency * t[:, None] + phase)).sum(axis=1)

    times = times_at(44.1e3)
    found = resample(lines(TIME)[:, None], RECORDED, times, 44.1e3)[:, 0]
    assert np.abs(found - lines(times)).max() < 5e-5 * size.sum()


def test_an_end_that_nothing_foretells_does_no_harm():
    noise = np.random.default_rng(4).normal(size=3000)
    found = resample(noise[:, None], RECORDED, np.arange(2645) / 44.1e3, 44.1e3)
    assert np.abs(found).max() < 1.5 * np.abs(noise).max()
    step = np.repeat([0.0, 1.0], [2999, 1])  # a jump at the last sample
    assert np.abs(resample(step[:, None], RECORDED, np.arange(2645) / 44.1e3, 44.1e3)).max() < 1.2


@pytest.mark.parametrize("samples", [2, 3, 10])
def test_a_few_samples_are_enough(samples):
    found = resample(np.full((samples, 1), 2.0), RECORDED, np.arange(4 * samples - 3) / (4 * RECORDED), 4 * RECORDED)
    np.testing.assert_allclose(found, 2.0, rtol=1e-5)  # a constant stays one


@pytest.mark.parametrize("rate", [20e3, 100e3])
def test_it_looks_no_farther_than_it_says(rate):
    values = np.random.default_rng(5).normal(size=(2000, 1))
    changed, beyond, at = values.copy(), reach(RECORDED, rate), 1000 / RECORDED
    changed[: 1000 - beyond], changed[1001 + beyond :] = 0, 0
    known, cut = (resample(x, RECORDED, [at], rate) for x in (values, changed))
    np.testing.assert_array_equal(known, cut)


def test_the_fraction_above_a_frequency_is_that_of_the_lines_there():
    time = np.arange(50_000) / RECORDED
    signal = 5 + 3 * np.sin(2 * np.pi * 1000 * time) + np.sin(2 * np.pi * 7000.3 * time)
    fraction, line = fraction_above(signal, RECORDED, 5000.0)
    assert fraction == pytest.approx(0.1, rel=1e-4)  # 1/(9 + 1); the window's leakage over kilohertz is below 1e-10
    assert line == pytest.approx(7000.3, abs=0.6)  # half a bin and a bit
    assert fraction_above(np.ones(100), RECORDED, 5000.0)[0] == 0
    assert fraction_above(signal, RECORDED, 25e3)[0] == 0


@pytest.mark.parametrize("slow", [1.0, 4.0, 0.5])
def test_a_sound_is_the_velocity_at_its_scale(slow):
    velocity = 0.3 + 0.02 * np.sin(2 * np.pi * 440 * TIME)
    sound = to_sound(velocity, RECORDED, slow=slow)
    with wave.open(io.BytesIO(wav_bytes(sound, "Title", "a comment"))) as file:
        assert (file.getnchannels(), file.getsampwidth(), file.getframerate()) == (1, 2, 44100)
        heard = np.frombuffer(file.readframes(file.getnframes()), "<i2")
    played = np.arange(heard.size) / 44100
    assert played[-1] == pytest.approx(TIME[-1] * slow, abs=1 / 44100)
    wanted = 0.02 * np.sin(2 * np.pi * 440 / slow * played)
    # Half a step, what the filter passes, and the mean of a record that is no whole number of periods.
    assert np.abs(heard * sound.scale - wanted + wanted.mean()).max() < sound.scale / 2 + 3e-5 * 0.32
    assert np.abs(heard).max() == round(32767 * 10 ** (-1 / 20))  # 1 dB below full scale: nothing is clipped
    assert sound.peak == pytest.approx(0.02, rel=0.02)


def test_what_is_at_the_right_rate_is_not_resampled():
    velocity = np.random.default_rng(6).normal(size=1000)
    sound = to_sound(velocity, 88200.0, slow=2)
    assert np.abs(sound.samples * sound.scale - (velocity - velocity.mean())).max() <= sound.scale * 0.5000001


def test_the_texts_of_a_sound_are_where_players_look_for_them():
    content = wav_bytes(to_sound(TIME, RECORDED), "Bremse ä", "odd")
    assert struct.unpack("<I", content[4:8])[0] == len(content) - 8
    found, at = {}, 12
    while at < len(content):
        name, size = content[at : at + 4], struct.unpack("<I", content[at + 4 : at + 8])[0]
        found[name] = content[at + 8 : at + 8 + size]
        at += 8 + size + size % 2
    assert list(found) == [b"fmt ", b"LIST", b"data"]
    assert b"INFOINAM\x0a\0\0\0Bremse \xc3\xa4\0ICMT\x04\0\0\0odd\0" in found[b"LIST"]


@pytest.mark.parametrize("velocity", [np.zeros(100), np.full(100, 0.1), 0.1 + 1e-15 * np.sin(np.arange(100))])
def test_silence_is_no_sound(velocity):
    with pytest.raises(ValueError, match="nothing to hear"):
        to_sound(velocity, RECORDED)
