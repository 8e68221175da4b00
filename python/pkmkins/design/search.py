# SPDX-License-Identifier: GPL-2.0-or-later
"""Proposes machines: NSGA-II of pymoo, which searches the front of several objectives at once, or a plain sample.

A generation is proposed as a whole and judged as a whole, in any order and anywhere: the search gets it sorted. So the
same study and seed give the same machines with any engine, and a stopped run continues by proposing
the same again, for which the record has the results.
"""

import numpy as np
from pymoo.algorithms.moo.nsga2 import NSGA2
from pymoo.core.evaluator import Evaluator
from pymoo.core.problem import Problem
from pymoo.operators.sampling.lhs import LHS
from pymoo.problems.static import StaticProblem
from scipy.stats.qmc import Halton

from .engine import Serial
from .record import Record
from .result import Front
from .study import OBJECTIVES

# The value of an objective that was not computed; candidates that violate a constraint are compared only by
# that.
UNMEASURED = 1e30


def design(study, results, *, engine=None, progress=lambda *_: None):
    """Runs a study to its end, or continues a stopped run; `results` is the file of judgements.

    `progress` is called with the number of candidates judged and the best of each objective so far. Returns the
    front. The result is the same to the bit with every engine.
    """
    engine = engine or Serial()
    with Record(results, study) as record:
        for _ in _generations(study, record, engine, progress):
            pass
        return Front.of(study, record)


def sample(study, results, shard, *, engine=None, progress=lambda *_: None):
    """Judges one part of a plain sample: number `shard[0]` of `shard[1]`, each with a separate file.

    The sample is Halton's sequence over the ranges, as many points as the study has candidates; `merge` combines the
    files.
    """
    engine = engine or Serial()
    number, count = shard
    points = Halton(len(study.ranges), rng=study.seed).random(study.candidates)
    low, high = _bounds(study)
    mine = (low + points * (high - low))[number - 1 :: count]
    with Record(results, study) as record:
        for start in range(0, len(mine), study.population):
            _judged(study, record, engine, mine[start : start + study.population], progress)
        return Front.of(study, record)


def merge(study, results, parts):
    """Combines files of judgements into one; repeated judgements count once."""
    with Record(results, study) as record:
        for part in parts:
            with Record(part, study) as other:
                for values, judgement in other.items():
                    record.add(values, judgement)
        return Front.of(study, record)


def _bounds(study):
    return np.array([one.low for one in study.ranges]), np.array([one.high for one in study.ranges])


def _generations(study, record, engine, progress):
    low, high = _bounds(study)
    problem = Problem(
        n_var=len(study.ranges), n_obj=len(study.objectives), n_ieq_constr=1, xl=low, xu=high
    )
    search = NSGA2(pop_size=study.population, sampling=LHS(), eliminate_duplicates=True)
    search.setup(problem, seed=study.seed, verbose=False)
    asked = 0
    while asked < study.candidates:
        proposed = search.ask()
        if proposed is None or len(proposed) == 0:
            return
        asked += len(proposed)
        judgements = _judged(study, record, engine, proposed.get("X"), progress)
        signs = [1.0 if OBJECTIVES[name] == "smallest" else -1.0 for name in study.objectives]
        values = np.array([one.objectives for one in judgements]) * signs
        broken = np.array([[sum(one.violations.values())] for one in judgements])
        known = StaticProblem(problem, F=np.nan_to_num(values, nan=UNMEASURED), G=broken)
        Evaluator().eval(known, proposed)
        search.tell(infills=proposed)
        yield


def _judged(study, record, engine, candidates, progress):
    """Returns judgements of candidates in their order, from the record or the engine."""
    candidates = [tuple(float(x) for x in row) for row in candidates]
    missing = list(dict.fromkeys(values for values in candidates if record.get(values) is None))
    for place, judgement in engine.each(study, missing):
        record.add(missing[place], judgement)
        progress(record)
    return [record.get(values) for values in candidates]
