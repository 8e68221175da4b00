# SPDX-License-Identifier: GPL-2.0-or-later
"""The search over geometries: which machine of a kind serves a purpose best, before one is built.

`study` reads what is asked, `candidate` judges one machine, `search` proposes machines generation by
generation, `record` keeps every judgement in a file as it comes, `engine` spreads judgements over
processes or computers, `result` shows what was found and writes the chosen machine,
`scatter` says what inaccuracies of making leave of it. The command is
`pkm design` (`command`).

`search.design` runs a study; it needs pymoo, which comes with `pip install pkmkins[design]`.
"""

from .candidate import Judgement, judge
from .result import Front, write_machine
from .scatter import scatter
from .study import Study, StudyError

__all__ = ["Front", "Judgement", "Study", "StudyError", "judge", "scatter", "write_machine"]
