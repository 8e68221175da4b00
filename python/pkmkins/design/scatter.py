# SPDX-License-Identifier: GPL-2.0-or-later
"""The effect of manufacturing errors on a machine: its objectives with an error in every dimension."""

from dataclasses import dataclass

import numpy as np

from .candidate import judge

# Number of sampled machines: their deviations are then accurate to a tenth.
DRAWN = 64


@dataclass(frozen=True)
class Scatter:
    """Mean and standard deviation of every objective over machines that fit, and the fraction that does."""

    mean: tuple
    deviation: tuple
    fitting: float

    def lines(self, study):
        """Returns a text for users, one line per objective."""
        listed = [f"  {name}: {m:.6g}, standard deviation {d:.3g}" for name, m, d in zip(study.objectives, self.mean, self.deviation)]
        return "\n".join([f"made within these tolerances {100 * self.fitting:.0f} % still keep their limits at the poses looked at:", *listed])


def scatter(study, values, length, angle, drawn=DRAWN):
    """Samples machines whose dimensions have normal errors: lengths of this standard deviation in machine units, angles
    in degrees. The numbers are the same in every run; dimensions that [fixed] names stay."""
    sigma = np.array([angle if "angle" in one.name else length for one in study.ranges])
    errors = np.random.default_rng(study.seed).normal(size=(drawn, len(sigma))) * sigma
    found = [judge(study, row) for row in np.asarray(values) + errors]
    fitting = np.array([one.objectives for one in found if one.fits]).reshape(-1, len(study.objectives))
    if len(fitting) < 2:
        nothing = (float("nan"),) * len(study.objectives)
        return Scatter(nothing, nothing, len(fitting) / drawn)
    return Scatter(tuple(fitting.mean(axis=0)), tuple(fitting.std(axis=0, ddof=1)), len(fitting) / drawn)
