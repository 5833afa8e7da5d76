"""What to change to make a brake quiet: a bar for every number and mode, the number that counts most on top."""

import numpy as np
from matplotlib.figure import Figure

from drumsqueal.questions.sensitivity.study import SensitivityStudy
from drumsqueal.terminal import style
from drumsqueal.terminal.style import frame, new_figure, styled

ROW = 0.8  # of the distance between two numbers that their bars take up
HATCHES = ("", "////", "....")  # of a second and a third mode of one name


@styled()
def draw_sensitivity(study: SensitivityStudy) -> Figure:
    """Draw the change of the growth rates of the modes that matter, per +1 % of each number."""
    shown = [study.modes[k] for k in study.relevant]
    kind = "unstable modes" if shown[0].unstable else "no mode is unstable; all"
    figure = new_figure(study.title, f"what +1 % of each number does to the growth rates ({kind})")
    axes = figure.subplots()
    places = np.arange(len(study.numbers))
    height = ROW / len(shown)
    for k, mode in enumerate(shown):
        values = [row.growth_per_percent_1_per_s[study.relevant[k]] for row in study.numbers]
        shift = (k - (len(shown) - 1) / 2) * height
        earlier = sum(other.name == mode.name for other in shown[:k])
        label = f"{mode.label}: {mode.frequency_Hz:.0f} Hz, {mode.growth_rate_1_per_s:+.3g} 1/s"
        axes.barh(
            places + shift,
            values,
            height=height,
            color=style.COLOUR[mode.name],
            hatch=HATCHES[min(earlier, len(HATCHES) - 1)],
            label=label,
        )
    axes.axvline(0, color=style.DARK, linewidth=0.6)
    axes.set_yticks(places, [row.key for row in study.numbers])
    axes.tick_params(axis="y", length=0)
    axes.set_ylim(len(study.numbers) - 0.5, -0.5)
    for place in places[1:]:
        axes.axhline(place - 0.5, color=style.FAINT, linewidth=0.4, zorder=0.5)
    frame(axes, "Change of the growth rate per +1 % (1/s): to the left it grows slower, to the right faster", None)
    figure.legend(loc="outside lower center", ncols=min(len(shown), 3))
    return figure
