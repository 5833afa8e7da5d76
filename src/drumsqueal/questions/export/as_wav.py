"""A sound: one signal as 16-bit PCM, its scale in the file and on the terminal."""

from pathlib import Path

from drumsqueal.errors import RequestError
from drumsqueal.findings.signals.sound import FULL_SCALE, HEADROOM_DB, to_sound, wav_bytes
from drumsqueal.progress import Progress
from drumsqueal.questions.export.channels import Channels


def write(channels: Channels, path: Path, progress: Progress) -> str:
    """Write the one signal at sample_rate / slow (Hz). Raises OSError, and RequestError for one that is silent."""
    if len(channels.channels) != 1:
        why = "a sound is of one signal, such as surface_velocity"
        raise RequestError(f"--signals {', '.join(each.name for each in channels.channels)}: {why}")
    (channel,) = channels.channels
    rate = round(channels.sample_rate / channels.slow)
    try:
        sound = to_sound(channel.values, channels.sample_rate, slow=channels.slow, rate=rate)
    except ValueError:
        raise RequestError(f"--to wav: {channel.name} is constant in this part; there is nothing to hear") from None
    replay = "" if channels.slow == 1 else f" played {channels.slow:g} times slower than it was,"
    scale = f"one step of the samples is {sound.scale:.9g} {channel.units}"
    comment = f"{channel.name}, {channel.meaning},{replay} {scale}, steady part left out"
    progress("writing", 0.0, None)
    path.write_bytes(wav_bytes(sound, channels.texts.get("title", ""), comment))
    return (
        f"{sound.samples.size / rate:.4g} s of sound at {rate} Hz,{replay} peak {sound.peak:.4g} {channel.units} at "
        f"-{HEADROOM_DB:g} dB of full scale, {sound.scale * FULL_SCALE:.4g} {channel.units}"
    )
