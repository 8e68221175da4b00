#!/usr/bin/python3
# SPDX-License-Identifier: GPL-2.0-or-later
"""Tests which traces `traces.py` considers the same motion."""

import sys
import unittest
from pathlib import Path

import numpy

sys.path.insert(0, str(Path(__file__).resolve().parent))
import traces  # noqa: E402

STEPS = [0.0, 1e-4, 5e-4, 1e-3, 1e-3, 5e-4, 1e-4]


def trace(pauses, change=None, off=None):
    """Returns motions of one joint and X, the n-th after `pauses[n]` cycles at rest."""
    x, places = 0.0, [[0.0] * 7]
    for pause in pauses:
        places += [list(places[-1]) for _ in range(pause)]
        for step in STEPS[1:]:
            x += step
            places.append([x, 0.0, 0.0, 0.0, 0.0, 0.0, 2 * x])
    places.append(list(places[-1]))
    if change:
        cycle, column, by = change
        places[cycle][column] += by
    on = [off is None or n < off for n in range(len(places))]
    return traces.Trace(numpy.arange(len(places)), numpy.array(places), numpy.array(on), numpy.zeros(len(places), bool))


class Compared(unittest.TestCase):
    def why(self, live, offline, is_stopped=False):
        return traces.compared(live, offline, is_stopped)["why"]

    def test_standstills_of_other_lengths_are_the_same(self):
        found = traces.compared(trace([3, 5]), trace([40, 2]))
        self.assertEqual((found["why"], found["motions"], found["difference"]), ("", 2, 0.0))
        self.assertEqual(found["ratio"], 1.0)

    def test_one_joint_in_one_cycle_beyond_the_tolerance_is_told_with_its_line(self):
        self.assertEqual(self.why(trace([3, 5]), trace([3, 5], (6, 6, 0.9e-9))), "")
        self.assertEqual(self.why(trace([3, 5]), trace([3, 5], (6, 6, 2e-9))), "motion 1, line 6: differs by 2.0e-09")

    def test_a_place_between_motions_counts(self):
        live, offline = trace([3, 5]), trace([3, 5])
        offline.places[10:, 1] += 1e-6
        self.assertIn("motion 1", self.why(live, offline))

    def test_a_motion_of_another_length_differs(self):
        live, offline = trace([3]), trace([3])
        between = (offline.places[5] + offline.places[6]) / 2
        offline = offline._replace(places=numpy.insert(offline.places, 6, between, axis=0))
        self.assertIn("6 cycles, 7 in virtual time", self.why(live, offline))

    def test_a_motion_that_is_missing_differs(self):
        self.assertEqual(self.why(trace([3, 5]), trace([3])), "1 motions in virtual time")
        self.assertEqual(self.why(trace([3]), trace([])), "0 motions in virtual time")

    def test_a_machine_that_stands_elsewhere_differs(self):
        self.assertEqual(self.why(trace([]), trace([])), "")
        here, there = trace([]), trace([])
        there.places[:, 0] = 1e-6
        self.assertEqual(self.why(here, there), "stands elsewhere")

    def test_what_comes_after_the_drives_are_off_does_not_count(self):
        self.assertEqual(self.why(trace([3], off=6), trace([3]), True), "")
        self.assertIn("cycles", self.why(trace([3], off=6), trace([3])))


class Figures(unittest.TestCase):
    def test_peaks_are_those_of_the_differences_with_their_lines(self):
        found = traces.figures(trace([3]), 0.001)
        self.assertAlmostEqual(found["speed"][0][0], 2.0)
        self.assertAlmostEqual(found["acceleration"][0][0], 1000.0)
        self.assertEqual(traces.stopped_line(trace([3])), 9)

    def test_a_tool_change_is_left_out_of_the_peaks(self):
        moved = trace([3])
        moved.busy[6] = True
        self.assertEqual(traces.figures(moved, 0.001)["speed"], [[0, 0]])


if __name__ == "__main__":
    unittest.main()
