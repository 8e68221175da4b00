# SPDX-License-Identifier: GPL-2.0-or-later
"""The search over geometries: which machine of a kind is best for a purpose, before one is built.

`study` reads the study, `candidate` judges one machine, `search` proposes machines generation by
generation, `record` appends every judgement to a file, `engine` distributes judgements over
processes or computers, `result` shows the results and writes the chosen machine,
`scatter` computes the effect of manufacturing errors. The command is
`pkm design` (`command`).

`search.design` runs a study; it needs pymoo, which comes with `pip install pkmkins[design]`.
"""

from .candidate import Judgement, judge
from .result import Front, write_machine
from .scatter import scatter
from .study import Study, StudyError

__all__ = ["Front", "Judgement", "Study", "StudyError", "judge", "scatter", "write_machine"]
