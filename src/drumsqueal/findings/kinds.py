"""What a motion is, whether it squeals, and the numbers by which all of that is decided."""

from enum import StrEnum


class Kind(StrEnum):
    """What a motion is, or where a start leads, as far as it is known.

    Steady sliding, or rest in it, a motion that is sustained, of a kind that is known or not, or one on its way. The
    size of a neutral motion depends on its start, and what runs away turns the shoe further than rotations are small.
    """

    STEADY = "steady"
    AT_REST = "at rest"
    RESTS = "rests elsewhere"
    DECAYS = "decays"
    GROWS = "grows"
    SETTLED = "settled"
    SQUEALS = "squeals"
    PERIODIC = "periodic"
    QUASI_PERIODIC = "quasi-periodic"
    CHAOTIC = "chaotic"
    IRREGULAR = "irregular"
    NEUTRAL = "neutral"
    RUNS_AWAY = "runs away"
    UNDECIDED = "undecided"
    FAILED = "failed"
    NOT_STARTED = "nothing was started"

    @classmethod
    def _missing_(cls, value: object) -> "Kind | None":
        """Read what files of earlier versions call undecided."""
        return cls.UNDECIDED if value in ("unknown", "not determined", "not settled") else None

    @property
    def squeals(self) -> bool:
        """Whether it is a motion that goes on by itself and has an amplitude of its own."""
        return self in (
            Kind.SQUEALS,
            Kind.PERIODIC,
            Kind.QUASI_PERIODIC,
            Kind.CHAOTIC,
            Kind.IRREGULAR,
        )

    @property
    def clear(self) -> bool:
        """Whether it is known where the motion leads, and the model holds there."""
        return self not in (Kind.GROWS, Kind.RUNS_AWAY, Kind.UNDECIDED, Kind.FAILED)


class Criteria:
    """The numbers that decide what a motion is, each with its reason; sizes are fractions unless a unit is given."""

    # Rest, and decay to it.
    steady = 1e-6  # of the size that would count as motion, below which it is none
    # Of the largest impulse: what departs less from the linear one is led by it. At another equilibrium, and at the one
    # that lies between, nothing pulls, so that the departure is all of the linear impulse: this is halfway there.
    led = 0.5
    nearly_linear = 0.5  # of the linear rate: what decays so fast is led by the linear model
    same_place = 1e-6  # of the pull of the linear springs: equilibria that Newton's method finds agree to 1e-13 of it
    small = 0.1  # of the nearer contact boundary, below which the motion is nearly linear
    beyond = 0.9  # of a boundary, from which on the linear model is no guide; a block that sticks just reaches it

    small_rotation = 0.1  # rad; the cosine that the model takes for 1 is off by half a per cent there

    # Change of the rms of a motion from half to half of what is looked at, below which it may have settled: that of an
    # irregular one fluctuates by itself. What recurs must keep its size to `recurrence.RECURRENCE`.
    drift = 0.1
    # A record begins where the rms over two blocks has no trend: by more of it, or by more standard errors.
    trend = 1e-3
    trend_errors = 3.0
    unclear_trend = 0.02  # of the rms: a trend less certain than that, as where growth ends, is none

    # The regime of a record.
    periods = 20  # of the lowest frequency of interest and of the period found, from which a regime can be decided
    longest_period = 20  # of the lowest frequency: among more lags every torus nearly closes
    explained = 0.99  # of the variance, in lines that are combinations of the fundamental frequencies of a torus
    faintest_line = 1e-2  # amplitude over that of the strongest line

    # Slow stick-slip.
    sticks_mostly = 0.5  # of the time: what sticks for longer has a period longer than those of free vibration
    # Cycles of which windows with smooth ends give the energy to 1e-5; of fewer it is that of whole cycles, which is as
    # uncertain as samples make their periods, 1e-4.
    many_cycles = 20
    fewest_cycles = 12  # in what is looked at: with fewer a round is made longer by
    longer = 8.0  # times at most, as where not one phase was seen
    longest = 300  # times the length of the others, from which on it is undecided instead

    # Where a start leads, by rounds of a transient.
    rounds = 60  # at most
    persistent = 3  # rounds that a motion must last to have settled
    lasting = 10  # and where it may only dwell next to an unstable cycle, as at the end of a bistable range
    linear_change = 0.1  # of the linear rate: what changes so slowly has settled
    # A motion that fluctuates by so much, and so many times more than a round before, is leaving what it was near: a
    # cycle fluctuates by 1e-5, and one was seen to grow from 1.1e-4 by 2.2 times a round for six rounds before it left.
    leaves = 1e-4
    faster = 1.2
    # A motion that fluctuates by less has an amplitude: one that fluctuated by 0.1 kept its energy within 1 % for three
    # rounds and lost it within ten. What fluctuates by more must go on as it was for so many rounds.
    constant = 1e-3
    irregular = 20
    scatter = 2.0  # standard errors of a trend: an energy that falls by less may not fall at all
    # Of the tolerance, a round: what falls by less keeps its energy as well as is known. The integrator itself was seen
    # to change the rms velocity of an undamped block by a quarter of the tolerance.
    resolved = 10.0
    remains = 0.02  # of the rms, by which a motion that has settled may still grow
    # Of the time: what sticks for longer, time and again, owes its energy to friction. Friction that does not fall only
    # takes energy while it sticks: its motions come to stick for an instant, seen as up to 3e-4 of the time.
    sticks = 0.01
    smaller = 0.7  # times a motion that comes back where it is an attractor, and stays so where it is one of many
    sure = 5e-3  # change of an amplitude in one round more, of what must last; samples make it uncertain by 0.3 %

    # Whether two motions are one: logarithms of the rms of each coordinate, and of the frequency. Settled squeal of the
    # brakes repeats to 0.5 % and 0.001 %; two attractors were seen that differ by 1.1 % in frequency.
    same_rms = 0.05
    same_frequency = 5e-3
    steady_drift = 0.02  # change of the rms from half to half below which a motion may be one that is known already
    close = 1e-3  # to the rms of one that is known, so that it need not come nearer
    fluctuations = 2.0  # standard deviations of a part: an irregular motion is known no better than it fluctuates
    most_fluctuation = 0.25  # which counts that much at most
    # At neighbouring values they are alike where the logarithms of energy and frequency differ by less.
    alike_energy = 0.5
    alike_frequency = 0.05
